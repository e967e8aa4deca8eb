// The polynomial of a mirror's aspheric terms, for the asphere_* files. Unit: mm.
#include "simd_*.cl"

// g(t) and its slope by t. Even and odd powers of t are summed apart, each by Horner's rule in t^2: processors work on
// the sums side by side. coefficient[k]: of an even power and of the next one, highest first.
INLINE void profile_sum(__constant Asphere *asphere, realv t, realv *g, realv *g_t) {
    const realv square = t * t;
    realv even = asphere->coefficient[0][0], odd = asphere->coefficient[0][1];
    realv even_slope = 0, odd_slope = 0;   // by t^2
    #pragma unroll
    for (int k = 1; k < (int)(sizeof(asphere->coefficient) / sizeof(asphere->coefficient[0])); ++k) {
        even_slope = even_slope * square + even;
        odd_slope = odd_slope * square + odd;
        even = even * square + asphere->coefficient[k][0];
        odd = odd * square + asphere->coefficient[k][1];
    }
    *g = even + t * odd;
    *g_t = odd + 2 * (t * (even_slope + t * odd_slope));
}

// Nearly the height [mm] at (x, y) [mm], to begin with.
INLINE realv asphere_guess(__constant Scene *scene, realv x_mm, realv y_mm) {
    __constant Asphere *asphere = &scene->asphere;
    const realv x = x_mm * asphere->inverse_radius, y = y_mm * asphere->inverse_radius, s = x * x + y * y;
    realv sum = asphere->about[0];
    #pragma unroll
    for (int k = 1; k < (int)(sizeof(asphere->about) / sizeof(real)); ++k) sum = sum * s + asphere->about[k];
    return sum * s;
}
