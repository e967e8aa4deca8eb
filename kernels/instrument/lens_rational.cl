// A lens whose radial distortion is a ratio of polynomials: k1 to k6. The verb of lens_polynomial.cl.
#include "simd_*.cl"

INLINE real lens_radial(__constant Lens *lens, real r2) {
    const real below = 1 + r2 * (lens->below[0] + r2 * (lens->below[1] + r2 * lens->below[2]));
    return r2 * (lens->above[0] + r2 * (lens->above[1] + r2 * lens->above[2])) / below;
}
