// Forward estimator: rays leave the screen, aimed at the mirror, and are counted where they land on the detector.
#include "path_forward.cl"
#include "detector.cl"
#include "accumulate_*.cl"

// A block of rays between its two passes.
typedef struct {
    realv a[BLOCK_VECTORS], b[BLOCK_VECTORS], slope_a[BLOCK_VECTORS], slope_b[BLOCK_VECTORS];
    maskv through[BLOCK_VECTORS];
    int index[BLOCK_VECTORS * WIDTH];
    intv missed, clipped, failed;         // negated lane counts
} Block;

// First pass, branch-free: all rays of the block to the camera's aperture.
INLINE void block_trace(Block *block, __constant Scene *scene, const Launch *launch, const Emitter *emitter,
                        uint stream, ulong first, uint count) {
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const maskv valid = to_mask(lane_index() + v * WIDTH < count);
        const PathForward path = path_forward(scene, emitter, sample_words(launch, stream, first + v * WIDTH));
        block->a[v] = path.a;
        block->b[v] = path.b;
        block->slope_a[v] = path.slope_a;
        block->slope_b[v] = path.slope_b;
        block->through[v] = valid & path.through;
        block->missed += to_int(valid & !path.on_mirror);
        block->clipped += to_int(valid & path.on_mirror & !path.through);
        block->failed += to_int(valid & path.on_mirror & (path.a != path.a));
    }
}

// Second pass: only the rays that came through the aperture. Returns how many of them landed on the detector.
INLINE uint block_detect(Block *block, __constant Scene *scene, Hits *hits, uint *off_detector) {
    int through = 0;
    for (int j = 0; j < BLOCK_VECTORS * WIDTH; ++j) {
        block->index[through] = j;
        through += ((MASK *)block->through)[j] & 1;
    }
    uint detected = 0;
    for (int i = 0; i < through; ++i) {
        const int j = block->index[i];
        const int pixel = detector_pixel(scene, ((real *)block->a)[j], ((real *)block->b)[j],
                                         ((real *)block->slope_a)[j], ((real *)block->slope_b)[j]);
        if (pixel < 0) continue;
        hits_add(hits, pixel);
        ++detected;
    }
    *off_detector += through - detected;
    return detected;
}

// Parameters: emitters [screen pixels]; slots [detector pixels]; origins [slots]; transport, ledger: 64-bit sums.
// Grid: (screen pixels of this launch, parts of its rays). A work-item traces rays_per_item rays of one screen pixel.
// Assumes: transport and ledger zeroed before the replicate's first launch.
__kernel void trace_forward(__constant Scene *scene, const Launch launch, __global const Emitter *emitters,
                            __global const int *slots, __global const int2 *origins, __global uint *transport,
                            __global uint *ledger, __local uint *tile) {
    const uint stream = launch.first_stream + get_global_id(0);
    const ulong begin = launch.first_ray + get_global_id(1) * launch.rays_per_item;
    const ulong end = min(begin + launch.rays_per_item, launch.first_ray + launch.ray_count);
    const Emitter emitter = emitters[stream];
    Hits hits = {&launch, slots, origins, transport, ledger, tile,
                 stream % launch.screen_columns, stream / launch.screen_columns};
    Block block;
    block.missed = block.clipped = block.failed = 0;
    uint detected = 0, off_detector = 0;

    hits_begin(&hits);
    for (ulong first = begin; first < end; first += BLOCK_VECTORS * WIDTH) {
        const uint count = (uint)min(end - first, (ulong)(BLOCK_VECTORS * WIDTH));
        block_trace(&block, scene, &launch, &emitter, stream, first, count);
        detected += block_detect(&block, scene, &hits, &off_detector);
    }
    hits_end(&hits);

    const uint failed = count_lanes(block.failed);
    sum64_add(ledger, FATE_DETECTED, detected);
    sum64_add(ledger, FATE_MISSED_MIRROR, count_lanes(block.missed));
    sum64_add(ledger, FATE_CLIPPED, count_lanes(block.clipped) - failed);
    sum64_add(ledger, FATE_OFF_DETECTOR, off_detector);
    sum64_add(ledger, FATE_FAILED, failed);
}
