// BSDF of a Harvey lobe [1/sr], b0 (1 + (d / l)^2)^(s / 2), at the square of the distance d in direction cosines from the
// specular direction. Scalar: few rays need it. scatter: b0, 1 / l^2, s / 2.
#include "simd_*.cl"

INLINE real scatter_bsdf(__constant Element *element, real distance2) {
    return element->scatter[0] * pow(1 + distance2 * element->scatter[1], element->scatter[2]);
}
