// BSDF of a Lambertian scatterer [1/sr]; verb as in scatter_harvey.cl.
#include "simd_*.cl"

INLINE real scatter_bsdf(__constant Element *element, real distance2) { return element->scatter[0]; }
