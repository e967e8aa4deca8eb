// Reading tables, one place per work-item. The same verb as gather_vector.cl.
#include "simd_*.cl"

INLINE void gather4(__global const real *table, intv place, realv *found) {
    for (int k = 0; k < 4; ++k) found[k] = table[place + k];
}
