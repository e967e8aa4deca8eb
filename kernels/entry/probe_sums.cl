// Probe: 64-bit sums by 32-bit atomics. For checks (irtscots_cl/stability/), never for a run.
#include "sum64.cl"

// Parameters: amounts, targets [grid 0]: what is added to which sum; sums: 64-bit sums, zeroed before.
// Grid: (any number of work-items, 1).
__kernel void probe_sums(__global const ulong *amounts, __global const uint *targets, __global uint *sums) {
    sum64_add(sums, targets[get_global_id(0)], amounts[get_global_id(0)]);
}
