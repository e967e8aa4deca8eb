// Benchmark only: multiply-adds and nothing else, the peak rate of a device.
#include "simd_*.cl"

// Independent chains: enough to hide the latency of two units, few enough to fit 16 registers. With 16 chains the
// kernel reached half this rate.
#define CHAINS 12

// Parameters: steps; result [grid 0]: sums of all lanes, so that the compiler keeps the work.
// Grid: (any number of work-items, 1). Each does steps x CHAINS x WIDTH multiply-adds.
__kernel void multiply_add(const uint steps, __global real *result) {
    realv chain[CHAINS];
    for (int i = 0; i < CHAINS; ++i) chain[i] = (realv)((real)(get_global_id(0) + i));
    for (uint step = 0; step < steps; ++step)
        #pragma unroll
        for (int i = 0; i < CHAINS; ++i) chain[i] = chain[i] * (real)0.999 + (real)0.001;
    real sum = 0;
    for (int i = 0; i < CHAINS; ++i)
        for (int lane = 0; lane < WIDTH; ++lane) sum += ((real *)&chain[i])[lane];
    result[get_global_id(0)] = sum;
}
