// Zernike deviation of the mirror along z and its gradient, by Horner's rule in t = 2 s - 1, s = (x^2 + y^2) /
// radius^2. For a few radial terms of low order, where cancellation between powers costs two digits at most. The host
// measures that; zernike_clenshaw.cl has no such limit. Frame: the mirror's. Unit: mm.
//
// W = sum over rows of c(t) B, where B is the real part (cosine rows) or the imaginary part (sine rows) of zeta^m,
// zeta = (x + i y) / radius. The coefficients come from irtscots_cl/maths/zernike/. The generated declarations
// list the rows (zernike_order, zernike_sine, zernike_count) and the most coefficients of one, so that all loops unroll.
#include "simd_*.cl"

// Adds the deviation [mm] at (x, y) [mm] to *sum, and its slopes to *slope_x and *slope_y.
INLINE void zernike_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x, realv *slope_y) {
    __constant Zernike *zernike = &scene->zernike;
    const realv x = x_mm * zernike->inverse_radius, y = y_mm * zernike->inverse_radius;
    const realv t = 2 * (x * x + y * y) - 1;
    realv height = 0, radial_slope = 0, gradient_x = 0, gradient_y = 0;
    realv power_re = 1, power_im = 0, lower_re = 0, lower_im = 0;   // zeta^m and zeta^(m-1)
    __constant real *coefficient = zernike->coefficient;
    int m = 0;
    #pragma unroll
    for (int row = 0; row < (int)(sizeof(zernike_order) / sizeof(int)); ++row) {
        #pragma unroll
        for (; m < zernike_order[row]; ++m) {
            lower_re = power_re;
            lower_im = power_im;
            power_re = m == 0 ? x : lower_re * x - lower_im * y;
            power_im = m == 0 ? y : lower_re * y + lower_im * x;
        }
        realv c = coefficient[0], c_dt = 0;                         // highest power first
        #pragma unroll
        for (int k = 1; k < zernike_most[0]; ++k) {
            if (k >= zernike_count[row]) break;
            c_dt = k == 1 ? c : c_dt * t + c;
            c = c * t + coefficient[k];
        }
        coefficient += zernike_count[row];
        // No compiler leaves out products with 0 and sums with it: what is not there is not written.
        const bool sine = zernike_sine[row], slopes = zernike_count[row] > 1;
        const realv base = sine ? power_im : power_re;
        const realv mc = m * c;
        height = row == 0 ? c * base : height + c * base;
        if (slopes) radial_slope += m == 0 ? c_dt : c_dt * base;
        if (m == 1 && sine) gradient_y += c;
        else if (m == 1) gradient_x += c;
        else if (m > 1) {
            gradient_x += mc * (sine ? lower_im : lower_re);
            gradient_y += mc * (sine ? lower_re : -lower_im);
        }
    }
    *sum += height;
    *slope_x += (gradient_x + 4 * x * radial_slope) * zernike->inverse_radius;
    *slope_y += (gradient_y + 4 * y * radial_slope) * zernike->inverse_radius;
}
