// Reading tables, one place per lane: four neighbours at once, in registers of four that are then transposed. That is
// several times faster than gathering single numbers. All of a lane's numbers are read before the next lane's, so that
// its address is made once.
#include "simd_*.cl"

typedef REAL quad __attribute__((ext_vector_type(4)));
typedef quad quad_anywhere __attribute__((aligned(sizeof(REAL))));   // at any number of a table

#define JOIN2(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7)
#if WIDTH == 16
#define JOIN(q, k) \
    __builtin_shufflevector(JOIN2(q[k], q[4 + k]), JOIN2(q[8 + k], q[12 + k]), 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, \
                            12, 13, 14, 15)
#define LOW(a, b) __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29)
#define HIGH(a, b) __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31)
#define FIRST(a, b) __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29)
#define SECOND(a, b) __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31)
#else
#define JOIN(q, k) JOIN2(q[k], q[4 + k])
#define LOW(a, b) __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13)
#define HIGH(a, b) __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15)
#define FIRST(a, b) __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13)
#define SECOND(a, b) __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15)
#endif

// found[j][k] = table[place + j * step + k] for j and k from 0 to 3.
INLINE void gather4x4(__global const real *table, intv place, int step, realv found[4][4]) {
    quad q[4][WIDTH];
    for (int lane = 0; lane < WIDTH; ++lane) {
        __global const real *at = table + ((const int *)&place)[lane];
        for (int j = 0; j < 4; ++j) q[j][lane] = *(__global const quad_anywhere *)(at + (size_t)j * step);
    }
    for (int j = 0; j < 4; ++j) {
        const realv a = JOIN(q[j], 0), b = JOIN(q[j], 1), c = JOIN(q[j], 2), d = JOIN(q[j], 3);
        const realv ab_low = LOW(a, b), ab_high = HIGH(a, b), cd_low = LOW(c, d), cd_high = HIGH(c, d);
        found[j][0] = FIRST(ab_low, cd_low);
        found[j][1] = SECOND(ab_low, cd_low);
        found[j][2] = FIRST(ab_high, cd_high);
        found[j][3] = SECOND(ab_high, cd_high);
    }
}
