// Accumulation for CPUs: a work-item owns a tile in local memory (its core's cache), adds to it without atomics and
// merges it into the transport once at the end. The same verbs as accumulate_atomic.cl, and the same sums bit for bit.
// Range of the tiles: a forward bin holds at most the work-item's rays, fewer than 2^32 (MAX_RAYS_PER_ITEM on the
// host); an adjoint bin at most that many weights below 2^31.
#include "window.cl"

// Forward: one screen pixel's hits, counted per detector pixel.
INLINE void hits_begin(Hits *hits) {
    for (int i = 0; i < hits->launch->detector_pixels; ++i) hits->tile[i] = 0;
}

INLINE void hits_add(Hits *hits, int pixel) { ++hits->tile[pixel]; }

INLINE void hits_end(Hits *hits) {
    for (int pixel = 0; pixel < hits->launch->detector_pixels; ++pixel)
        if (hits->tile[pixel] != 0) hits_store(hits, pixel, hits->tile[pixel]);
}

// Adjoint: one detector pixel's window, then its fates.
INLINE void light_begin(Light *light) {
    for (int i = 0; i < light->bins; ++i) light->tile[i] = 0;
}

INLINE void light_add(Light *light, int bin, long amount) { light->tile[bin] += (ulong)amount; }

// Bins from `first` on, that hold sums up to the ends of `lines` lines, turned into second differences: of the light of
// line k and k - 1 in bin k, which is no light before the first line and after the last.
INLINE void light_differences(Light *light, int lines, int first) {
    __local ulong *sums = light->tile + first;
    ulong below = 0, before = 0;   // the light below the line, and that of the line before
    for (int line = 0; line < lines; ++line) {
        const ulong own = sums[line] - below;
        below = sums[line];
        sums[line] = own - before;
        before = own;
    }
    sums[lines] = 0 - before;
}

INLINE void light_end(Light *light) {
    for (int bin = 0; bin < light->bins; ++bin)
        if (light->tile[bin] != 0) light_store(light, bin, light->tile[bin]);
}
