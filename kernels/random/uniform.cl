// Random words to real numbers. Results are exact in single precision, symmetric, and never reach the interval's ends.
#include "simd_*.cl"

// (-1/2, 1/2): the odd multiples of 2^-25, 2^24 of them. Never 0 and never +-1/2.
INLINE realv uniform_centred(uintv word) {
    return to_real(as_intv(word) >> 8) * (real)0x1p-24 + (real)0x1p-25;
}

// (0, 1): the odd multiples of 2^-24, 2^23 of them. Never 0 and never 1.
INLINE realv uniform_open(uintv word) {
    return to_real(as_intv(word >> 9)) * (real)0x1p-23 + (real)0x1p-24;
}

// sin(pi t) / t and cos(pi t) as polynomials in t^2 for |t| <= 1/2: Chebyshev fits, absolute error below 7e-9 (the
// words have steps of 6e-8).
#define S0 (real)3.14159264013
#define S1 (real)-5.16771008351
#define S2 (real)2.55007752321
#define S3 (real)-0.59829128562
#define S4 (real)0.0776576603042
#define C0 (real)0.99999999978
#define C1 (real)-4.93480213708
#define C2 (real)4.05870915956
#define C3 (real)-1.33521200305
#define C4 (real)0.234937313821
#define C5 (real)-0.0243963243548

// A point of the unit disk, uniform in area: radius from the first word, angle from the second.
// Sine and cosine of half the angle come from short polynomials; double-angle formulas give the rest.
INLINE void unit_disk(uintv radius_word, uintv angle_word, realv *x, realv *y) {
    const realv radius = real_sqrt(uniform_open(radius_word));
    const realv t = uniform_centred(angle_word);
    const realv s = t * t;
    const realv sine = t * ((((S4 * s + S3) * s + S2) * s + S1) * s + S0);
    const realv cosine = ((((C5 * s + C4) * s + C3) * s + C2) * s + C1) * s + C0;
    *x = radius * (1 - 2 * sine * sine);
    *y = radius * 2 * sine * cosine;
}
