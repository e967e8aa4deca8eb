// Reading tables, one place per work-item. The same verb as gather_vector.cl.
#include "simd_*.cl"

INLINE void gather4x4(__global const real *table, intv place, int step, realv found[4][4]) {
    for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 4; ++k) found[j][k] = table[(size_t)place + (size_t)j * step + k];
}
