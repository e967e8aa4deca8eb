// Accumulation of ramps by their ends: four numbers each, whatever the size of the window. For GPUs, and for windows of
// many lines. The same verbs as ramps_edges.cl.
#include "ramp_ends.cl"
#include "accumulate_*.cl"

// Adds the ramps of a block to the bins from `first` on: second differences of the light below the lines' edges.
INLINE void ramps_add(Light *light, const Ramp *ramps, int vectors, int lines, int first) {
    for (int v = 0; v < vectors; ++v) {
        const Steps steps = ramp_steps(&ramps[v], lines);
        for (int lane = 0; lane < WIDTH; ++lane)
            for (int end = 0; end < 2; ++end) {
                const int bin = first + ((const int *)&steps.bin[end])[lane];
                const int upper = ((const int *)&steps.upper[end])[lane];
                const int lower = ((const int *)&steps.slope)[lane] - upper;
                light_add(light, bin, end == 0 ? lower : -lower);
                light_add(light, bin + 1, end == 0 ? upper : -upper);
            }
    }
}

INLINE void ramps_end(Light *light, int lines, int first) {}
