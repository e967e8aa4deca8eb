// Zernike deviation of the mirror along z and its gradient, by Clenshaw's recurrence on Jacobi polynomials: stable to
// radial order 40 and beyond, unlike the sums of powers of zernike_power.cl. Frame: the mirror's. Unit: mm.
//
// W = sum over azimuthal orders m of Re[conj(a_m) zeta^m], zeta = (x + i y) / radius, s = |zeta|^2, where a_m's real
// part (cosine terms) and imaginary part (sine terms) are series sum_k c_k P_k(t) in t = 2 s - 1 with P_{k+1} =
// (alpha_k t + beta_k) P_k + gamma_k P_{k-1}. The tables come from irtscots_cl/maths/zernike/.
#include "simd_*.cl"

// The two series of one azimuthal order and their derivatives by t.
typedef struct { realv cosine, sine, cosine_dt, sine_dt; } Radial;

INLINE Radial zernike_radial(__constant ZernikeTerm *term, int count, realv t) {
    Radial b = {0, 0, 0, 0}, b_next = {0, 0, 0, 0};
    for (int k = count - 1; k >= 0; --k) {
        const real alpha = term[k].alpha, gamma = term[k].gamma_next;
        const realv step = alpha * t + term[k].beta;
        const Radial now = {term[k].cosine + step * b.cosine + gamma * b_next.cosine,
                            term[k].sine + step * b.sine + gamma * b_next.sine,
                            step * b.cosine_dt + alpha * b.cosine + gamma * b_next.cosine_dt,
                            step * b.sine_dt + alpha * b.sine + gamma * b_next.sine_dt};
        b_next = b;
        b = now;
    }
    return b;
}

// Adds the deviation [mm] at (x, y) [mm] to *sum, and its slopes to *slope_x and *slope_y.
INLINE void zernike_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x, realv *slope_y) {
    __constant Zernike *zernike = &scene->zernike;
    const realv x = x_mm * zernike->inverse_radius, y = y_mm * zernike->inverse_radius;
    const realv t = 2 * (x * x + y * y) - 1;
    realv height = 0, radial_slope = 0, gradient_x = 0, gradient_y = 0;
    realv power_re = 1, power_im = 0, lower_re = 0, lower_im = 0;   // zeta^m and zeta^(m-1)
    int m = 0, first = 0;
    for (int series = 0; series < zernike->series_count; ++series) {
        for (; m < zernike->order[series]; ++m) {
            lower_re = power_re;
            lower_im = power_im;
            power_re = lower_re * x - lower_im * y;
            power_im = lower_re * y + lower_im * x;
        }
        const Radial a = zernike_radial(zernike->term + first, zernike->count[series], t);
        first += zernike->count[series];
        height += a.cosine * power_re + a.sine * power_im;
        radial_slope += a.cosine_dt * power_re + a.sine_dt * power_im;
        gradient_x += m * (a.cosine * lower_re + a.sine * lower_im);
        gradient_y += m * (a.sine * lower_re - a.cosine * lower_im);
    }
    *sum += height;
    *slope_x += (gradient_x + 4 * x * radial_slope) * zernike->inverse_radius;
    *slope_y += (gradient_y + 4 * y * radial_slope) * zernike->inverse_radius;
}
