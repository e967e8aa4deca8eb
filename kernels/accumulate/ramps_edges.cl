// Accumulation of ramps for CPUs: the light below every edge of a window's lines, all rays of a block side by side. The
// cost of a ray grows with the window. The same verbs as ramps_steps.cl; needs a tile.
#include "chord.cl"
#include "accumulate_*.cl"

// Adds the ramps of a block to the bins from `first` on, which hold the light below the lines' upper edges until
// ramps_end. Range: a lane's sum has at most BLOCK_VECTORS amounts of at most 2^26 (LINE_WEIGHT_ONE on the host).
INLINE void ramps_add(Light *light, const Ramp *ramps, int vectors, int lines, int first) {
    for (int edge = 1; edge <= lines; ++edge) {
        intv sum = 0;
        for (int v = 0; v < vectors; ++v) {
            const realv end = ramps[v].high < edge ? ramps[v].high : (realv)(edge);
            const realv below = (end - ramps[v].low) * ramps[v].slope + (real)0.5;
            sum += to_int(below > 0 ? below : (realv)(0));
        }
        light_add(light, first + edge - 1, sum_lanes(sum));
    }
}

INLINE void ramps_end(Light *light, int lines, int first) { light_differences(light, lines, first); }
