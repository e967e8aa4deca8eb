// Benchmark only: multiply-adds and nothing else, the most that a device can do.
#include "simd_*.cl"

#define CHAINS 16

// Parameters: steps; result [grid 0 x WIDTH x ...]: keeps the sums alive.
// Grid: (any number of work-items, 1). Each does steps x CHAINS x WIDTH multiply-adds.
__kernel void multiply_add(const uint steps, __global real *result) {
    realv chain[CHAINS];
    for (int i = 0; i < CHAINS; ++i) chain[i] = (realv)((real)(get_global_id(0) + i));
    for (uint step = 0; step < steps; ++step)
        #pragma unroll
        for (int i = 0; i < CHAINS; ++i) chain[i] = chain[i] * (real)0.999 + (real)0.001;
    real sum = 0;
    for (int i = 0; i < CHAINS; ++i) sum += ((real *)&chain[i])[0];
    result[get_global_id(0)] = sum;
}
