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
    uintv through;                        // rays that passed the camera's aperture: bit v for that of vector v
    intv on_mirror, clipped;              // counts per lane
} Block;

// Rays beyond the last count for nothing. Only a run's last block has any.
INLINE void block_end(Block *block, uint count) {
    for (int v = 0; v < BLOCK_VECTORS; ++v) block->meetings[v].on_mirror &= to_mask(lane_index() + v * WIDTH < count);
}

// First passes, branch-free: trace all rays of the block to the camera's aperture.
INLINE void block_trace(Block *block, __constant Scene *scene, __global const real *tables, const Emitter *emitter,
                        Sampler *sampler, ulong first, uint count) {
    sampler_block(sampler, first, &block->words);
    for (int v = 0; v < BLOCK_VECTORS; ++v) block->aims[v] = forward_aim(emitter, &block->words, v);
    for (int v = 0; v < BLOCK_VECTORS; ++v)
        block->lines[v] = forward_emit(scene, emitter, &block->aims[v], &block->words, v);
    for (int v = 0; v < BLOCK_VECTORS; ++v) block->meetings[v] = mirror_meet(scene, tables, &block->lines[v]);
    for (int v = 0; v < BLOCK_VECTORS; ++v) mirror_deviate(scene, tables, &block->lines[v], &block->meetings[v]);
    if (count < BLOCK) block_end(block, count);
    intv on_mirror = block->on_mirror, clipped = block->clipped;
    maskv passed = 0;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        maskv through, stopped;
        block->arrivals[v] = forward_arrive(scene, &block->lines[v], &block->meetings[v], &through, &stopped);
        passed |= through & (1 << v);
        on_mirror = count_mask(on_mirror, block->meetings[v].on_mirror);
        clipped = count_mask(clipped, stopped);
    }
    block->through = as_uintv(to_int(passed));
    block->on_mirror = on_mirror;
    block->clipped = clipped;
}

// Last pass: only the rays that passed the aperture. Returns how many of them landed on the detector.
INLINE uint block_detect(const Block *block, __constant Scene *scene, Hits *hits, uint *off_detector) {
    uint through = 0, detected = 0;
    for (int pair = 0; pair < LANE_PAIRS; ++pair) {
        for (ulong rays = pair_bits(block->through, pair); rays != 0; rays &= rays - 1, ++through) {
            const int bit = lowest_bit(rays), lane = 2 * pair + bit / 32;
            const Arrival *at = &block->arrivals[bit % 32];
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
