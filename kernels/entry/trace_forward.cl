// Forward estimator: rays leave the screen, aimed at the mirror, and are counted where they land on the detector.
// Frames and stages as in path_forward.cl. Unit: mm.
#include "work_item.cl"
#include "path_forward.cl"
#include "detector.cl"
#include "accumulate_*.cl"

// A block of rays between its passes. Passes are short on purpose. A path is one long chain of dependent operations; a
// processor sees enough rays at a time to keep its units busy only if the loop is short (docs/performance.md).
typedef struct {
    Words words;
    Direction aims[BLOCK_VECTORS];
    Line lines[BLOCK_VECTORS];
    Meeting meetings[BLOCK_VECTORS];
    Arrival arrivals[BLOCK_VECTORS];
    ulong through[BLOCK_VECTORS];         // lanes that passed the camera's aperture, from mask_word
    intv on_mirror, clipped;              // counts per lane
} Block;

// First passes, branch-free: trace all rays of the block to the camera's aperture.
INLINE void block_trace(Block *block, __constant Scene *scene, __global const real *tables, const Emitter *emitter,
                        Sampler *sampler, ulong first, uint count) {
    sampler_block(sampler, first, &block->words);
    for (int v = 0; v < BLOCK_VECTORS; ++v) block->aims[v] = forward_aim(emitter, &block->words, v);
    for (int v = 0; v < BLOCK_VECTORS; ++v)
        block->lines[v] = forward_emit(scene, emitter, &block->aims[v], &block->words, v);
    for (int v = 0; v < BLOCK_VECTORS; ++v) block->meetings[v] = mirror_meet(scene, tables, &block->lines[v]);
    for (int v = 0; v < BLOCK_VECTORS; ++v) mirror_deviate(scene, tables, &block->lines[v], &block->meetings[v]);
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const maskv valid = to_mask(lane_index() + v * WIDTH < count);
        const Arrival at = forward_arrive(scene, &block->lines[v], &block->meetings[v]);
        block->arrivals[v] = at;
        block->through[v] = mask_word(valid & at.through);
        block->on_mirror = count_mask(block->on_mirror, valid & block->meetings[v].on_mirror);
        block->clipped = count_mask(block->clipped, valid & at.clipped);
    }
}

// Last pass: only the rays that passed the aperture. Returns how many of them landed on the detector.
INLINE uint block_detect(const Block *block, __constant Scene *scene, Hits *hits, uint *off_detector) {
    uint through = 0, detected = 0;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const Arrival *at = &block->arrivals[v];
        for (ulong lanes = block->through[v]; lanes != 0; lanes &= lanes - 1, ++through) {
            const int lane = lowest_lane(lanes);
            const int pixel = detector_pixel(scene, ((const real *)&at->a)[lane], ((const real *)&at->b)[lane],
                                             ((const real *)&at->slope_a)[lane], ((const real *)&at->slope_b)[lane]);
            if (pixel < 0) continue;
            hits_add(hits, pixel);
            ++detected;
        }
    }
    *off_detector += through - detected;
    return detected;
}

// Parameters: tables: of the mirror, where a file of its kind reads any; emitters [screen pixels]; visible_pixels
// [detector pixels]; origins [visible pixels]; transport, ledger: 64-bit sums.
// Grid: (screen pixels of this launch, runs of its rays). A work-item traces rays_per_item rays of one screen pixel.
// Assumes: transport and ledger were zeroed before the replicate's first launch.
__kernel void trace_forward(__constant Scene *scene, const Launch launch, __global const real *tables,
                            __global const Emitter *emitters, __global const int *visible_pixels,
                            __global const int2 *origins, __global uint *transport, __global uint *ledger,
                            __local uint *tile) {
    const WorkItem item = work_item(&launch);
    const uint source = item.source;
    const Emitter emitter = emitters[source];
    Hits hits = {&launch, visible_pixels, origins, transport, ledger, tile,
                 source % launch.screen_columns, source / launch.screen_columns};
    Sampler sampler;
    sampler_begin(&sampler, &launch, source);
    Block block;
    block.on_mirror = block.clipped = 0;
    uint detected = 0, off_detector = 0;

    hits_begin(&hits);
    for (ulong first = item.begin; first < item.end; first += BLOCK) {
        const uint count = (uint)min(item.end - first, (ulong)(BLOCK));
        block_trace(&block, scene, tables, &emitter, &sampler, first, count);
        detected += block_detect(&block, scene, &hits, &off_detector);
    }
    hits_end(&hits);

    const uint on_mirror = count_lanes(block.on_mirror), clipped = count_lanes(block.clipped);
    sum64_add(ledger, FATE_DETECTED, detected);
    sum64_add(ledger, FATE_MISSED_MIRROR, (uint)(item.end - item.begin) - on_mirror);
    sum64_add(ledger, FATE_CLIPPED, clipped);
    sum64_add(ledger, FATE_OFF_DETECTOR, off_detector);
    sum64_add(ledger, FATE_FAILED, on_mirror - clipped - detected - off_detector);
}
