// A polynomial in x and y above the mirror's quadric, along z, and its gradient. Frame: the mirror's. Unit: mm.
//
// W = sum over rows j and columns i of c_ji T_i(u) T_j(v), u and v from -1 to 1 over a rectangle that covers the mirror.
// All T_n are at most 1 there, so that nothing cancels but what cancels in W itself. dT_n/du = n U_{n-1}; T and U both
// obey P_{n+1} = 2 u P_n - P_{n-1}. The coefficients come from irtscots_cl/maths/xy_polynomials.py. The generated
// declaration polynomial_count has the length of each row, so that the loops unroll.
#include "simd_*.cl"

#define POLYNOMIAL_COLUMNS ((int)(sizeof(((Polynomial *)0)->coefficient[0]) / sizeof(real)))
#define POLYNOMIAL_ROWS ((int)(sizeof(polynomial_count) / sizeof(int)))

// T_i(u), or all dT_i/du, of every column.
INLINE void polynomial_columns(realv u, realv value[POLYNOMIAL_COLUMNS], realv slope[POLYNOMIAL_COLUMNS]) {
    realv now = 1, before = u, second = 0, second_before = -1;   // T_i, T_{i-1}, U_{i-1}, U_{i-2}
    #pragma unroll
    for (int i = 0; i < POLYNOMIAL_COLUMNS; ++i) {
        value[i] = now;
        slope[i] = i * second;
        const realv next = 2 * u * now - before, second_next = 2 * u * second - second_before;
        before = now;
        now = next;
        second_before = second;
        second = second_next;
    }
}

// Adds the height [mm] at (x, y) [mm] to *sum, and its slopes to *slope_x and *slope_y.
INLINE void polynomial_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x,
                           realv *slope_y) {
    __constant Polynomial *polynomial = &scene->polynomial;
    const realv u = (x_mm - polynomial->centre_x) * polynomial->inverse_half_x;
    const realv v = (y_mm - polynomial->centre_y) * polynomial->inverse_half_y;
    realv value[POLYNOMIAL_COLUMNS], slope[POLYNOMIAL_COLUMNS];
    polynomial_columns(u, value, slope);
    realv height = 0, gradient_x = 0, gradient_y = 0;
    realv now = 1, before = v, second = 0, second_before = -1;   // T_j, T_{j-1}, U_{j-1}, U_{j-2} of v
    #pragma unroll
    for (int j = 0; j < POLYNOMIAL_ROWS; ++j) {
        realv row = 0, row_slope = 0;
        #pragma unroll
        for (int i = 0; i < polynomial_count[j]; ++i) {
            row += polynomial->coefficient[j][i] * value[i];
            row_slope += polynomial->coefficient[j][i] * slope[i];
        }
        height += row * now;
        gradient_x += row_slope * now;
        gradient_y += row * (j * second);
        const realv next = 2 * v * now - before, second_next = 2 * v * second - second_before;
        before = now;
        now = next;
        second_before = second;
        second = second_next;
    }
    *sum += height;
    *slope_x += gradient_x * polynomial->inverse_half_x;
    *slope_y += gradient_y * polynomial->inverse_half_y;
}
