// A lens whose radial distortion is a polynomial: k1, k2, k3.
#include "simd_*.cl"

// The radial factor less 1, so that a weak distortion keeps its digits. r2: square of the normalised radius.
INLINE real lens_radial(__constant Lens *lens, real r2) {
    return r2 * (lens->above[0] + r2 * (lens->above[1] + r2 * lens->above[2]));
}
