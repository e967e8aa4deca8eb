// Probe: 64-bit sums by 32-bit atomics. For checks by irtscots_cl/stability/ only.
#include "sum64.cl"

// Parameters: amounts, targets [grid 0]: each amount, and the index of its sum; sums: 64-bit sums, zeroed before.
// Grid: (any number of work-items, 1).
__kernel void probe_sums(__global const ulong *amounts, __global const uint *targets, __global uint *sums) {
    sum64_add(sums, targets[get_global_id(0)], amounts[get_global_id(0)]);
}
