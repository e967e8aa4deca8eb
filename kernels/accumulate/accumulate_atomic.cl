// Accumulation directly into global memory by atomics. For GPUs, where thousands of work-items run at once and none can
// own a tile; and for CPUs if a tile would not fit, or costs too much for the few rays of a source. The same verbs as
// accumulate_tile.cl, and the same sums bit for bit.
#include "window.cl"

INLINE void hits_begin(Hits *hits) {}
INLINE void hits_add(Hits *hits, int pixel) { hits_store(hits, pixel, 1); }
INLINE void hits_end(Hits *hits) {}

INLINE void light_begin(Light *light) {}
INLINE void light_add(Light *light, int bin, long amount) { light_store(light, bin, (ulong)amount); }
INLINE void light_end(Light *light) {}
