// Self-test: known answers for the operations that all kernels use. irtscots_cl/opencl/selftest.py runs it on a device
// before the first trace.
#include "philox.cl"
#include "sum64.cl"

#define KEYS 3

// Parameters: numbers [grid 0][3][WIDTH]: x, y, z; reals [grid 0][3][WIDTH]: the root of x, x / y, x * y + z; counters
// [KEYS][4], keys [KEYS][2]; words [grid 0][WORD_LANES][4]: those of counter and key (i + l) % KEYS for work-item i and
// lane l; amounts, targets [grid 0]: each amount, and the index of its 64-bit sum. sums: zeroed before. Grid: (any
// number of work-items, 1).
__kernel void self_test(__global const real *numbers, __global const uint *counters, __global const uint *keys,
                        __global const ulong *amounts, __global const uint *targets, __global real *reals,
                        __global uint *words, __global uint *sums) {
    const size_t item = get_global_id(0);
    realv given[3];
    for (int i = 0; i < 3; ++i)
        for (int lane = 0; lane < WIDTH; ++lane)
            ((real *)&given[i])[lane] = numbers[(item * 3 + i) * WIDTH + lane];
    const realv found[3] = {real_sqrt(given[0]), given[0] / given[1], given[0] * given[1] + given[2]};
    for (int i = 0; i < 3; ++i)
        for (int lane = 0; lane < WIDTH; ++lane)
            reals[(item * 3 + i) * WIDTH + lane] = ((const real *)&found[i])[lane];

    Philox counter;
    for (int lane = 0; lane < WORD_LANES; ++lane)   // neighbours differ, so that exchanged lanes are found
        for (int i = 0; i < 4; ++i) ((uint *)&counter.word[i])[lane] = counters[(item + lane) % KEYS * 4 + i];
    for (int key = 0; key < KEYS; ++key) {
        const Philox out = philox4x32_10(counter, keys[2 * key], keys[2 * key + 1]);
        for (int lane = 0; lane < WORD_LANES; ++lane)
            if ((item + lane) % KEYS == key)
                for (int i = 0; i < 4; ++i)
                    words[(item * WORD_LANES + lane) * 4 + i] = ((const uint *)&out.word[i])[lane];
    }

    sum64_add(sums, targets[item], amounts[item]);
}
