// BSDF of the ABg model [1/sr], A / (B + d^g); verb as in scatter_harvey.cl. scatter: A, B, g / 2.
#include "simd_*.cl"

INLINE real scatter_bsdf(__constant Element *element, real distance2) {
    return element->scatter[0] / (element->scatter[1] + pow(distance2, element->scatter[2]));
}
