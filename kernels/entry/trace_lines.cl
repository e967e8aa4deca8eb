// Smoothed adjoint estimator: a ray stands for its whole chord through the camera's aperture. The chord lands on the
// screen as a short straight piece and is summed by lines in closed form. This gives light curves with far less noise,
// but no map. Frames and stages as in path_adjoint.cl. Unit: mm.
//
// Each ray has two chords through its aperture point, one for each scan. Along the chord for x, the landing point moves
// along the screen's x alone; likewise for y. Given its chord, a ray's point is uniform along it, so summing the chord
// instead of the point leaves every mean unchanged.
#include "work_item.cl"
#include "path_adjoint.cl"
#include "ramps_*.cl"

// A block of rays between its passes. trace_forward.cl says why the passes are short.
typedef struct {
    Words words;
    Line lines[BLOCK_VECTORS];
    Meeting meetings[BLOCK_VECTORS];
    realv weight[BLOCK_VECTORS];
    intv fate[BLOCK_VECTORS];
    Ramp ramps[2][BLOCK_VECTORS];         // along x, along y
} Block;

// Traces vector v of a block of count rays from the mirror to the screen: sets its ramps and fates. cut: whether the
// mirror's edges may cut the receiver's chords. Returns which rays are not simply detected.
INLINE maskv lines_arrive(Block *block, __constant Scene *scene, const Launch *launch, const LineReceiver *receiver,
                          int v, int count, bool cut) {
    const Meeting *met = &block->meetings[v];
    const maskv traced = to_mask(as_intv(lane_index()) + v * WIDTH < count);
    realv a, b, at_u, at_v;
    adjoint_aperture(scene, &block->words, v, &a, &b);
    const maskv ahead = adjoint_arrive(scene, &receiver->start, &block->lines[v], met, &at_u, &at_v);
    const realv x = at_u * scene->inverse_screen_pitch_x + (scene->screen_left - receiver->start.column);
    const realv y = at_v * scene->inverse_screen_pitch_y + (scene->screen_top - receiver->start.row);
    const maskv row_on = ahead & (y >= -receiver->start.row) & (y < launch->screen_rows - receiver->start.row);
    const maskv column_on = ahead & (x >= -receiver->start.column)
                            & (x < launch->screen_columns - receiver->start.column);
    const realv weight = block->weight[v] * receiver->start.weight_scale;
    maskv beyond = chord_ramp(scene, &receiver->chords[0], met, a, b, x, row_on & traced ? weight : (realv)(0),
                              receiver->start.column, launch->window_columns, launch->screen_columns, cut,
                              &block->ramps[0][v]);
    beyond |= chord_ramp(scene, &receiver->chords[1], met, a, b, y, column_on & traced ? weight : (realv)(0),
                         receiver->start.row, launch->window_rows, launch->screen_rows, cut, &block->ramps[1][v]);
    maskv fate = row_on & column_on ? (maskv)(FATE_DETECTED) : (maskv)(FATE_OFF_SCREEN);
    fate = at_u != at_u ? (maskv)(FATE_FAILED) : fate;
    fate = met->on_mirror ? fate : (maskv)(FATE_MISSED_MIRROR);
    fate = beyond ? (maskv)(FATE_OFF_WINDOW) : fate;
    block->fate[v] = to_int(fate);
    return fate != FATE_DETECTED;
}

// First passes, branch-free, for a block of count rays. Returns false if all of them are detected.
INLINE bool block_trace(Block *block, __constant Scene *scene, __global const real *tables, const Launch *launch,
                        const LineReceiver *receiver, Sampler *sampler, ulong first, int count) {
    const int vectors = (count + WIDTH - 1) / WIDTH;
    maskv others = 0;
    sampler_block(sampler, first, &block->words);
    for (int v = 0; v < vectors; ++v)
        block->lines[v] = adjoint_emit(scene, &receiver->start, &block->words, v, &block->weight[v]);
    for (int v = 0; v < vectors; ++v) block->meetings[v] = mirror_meet(scene, tables, &block->lines[v]);
    for (int v = 0; v < vectors; ++v) mirror_deviate(scene, tables, &block->lines[v], &block->meetings[v]);
    if (receiver->cut)
        for (int v = 0; v < vectors; ++v)
            others |= lines_arrive(block, scene, launch, receiver, v, count, true);
    else
        for (int v = 0; v < vectors; ++v)
            others |= lines_arrive(block, scene, launch, receiver, v, count, false);
    return mask_word(others) != 0;
}

// Parameters: tables: of the mirror, where a file of its kind reads any; receivers [visible pixels]; transport: 64-bit
// sums [visible pixels][window columns + 2 + window rows + 2], second differences of the light below each line's edge,
// along x then along y; ledger: 64-bit sums. Grid: (visible pixels of this launch, runs of its rays). A work-item
// traces rays_per_item rays of one detector pixel. Assumes: transport and ledger were zeroed before the replicate's
// first launch; windows lie inside the screen.
__kernel void trace_lines(__constant Scene *scene, const Launch launch, __global const real *tables,
                          __global const LineReceiver *receivers, __global uint *transport, __global uint *ledger,
                          __local ulong *tile) {
    const WorkItem item = work_item(&launch);
    const uint visible_pixel = item.source;
    const LineReceiver receiver = receivers[visible_pixel];
    const int of_x = launch.window_columns + 2, bins = of_x + launch.window_rows + 2;
    Light light = {transport + 2 * (size_t)visible_pixel * bins, ledger, tile, bins, bins + FATE_COUNT};
    Sampler sampler;
    sampler_begin(&sampler, &launch, receiver.start.pixel);
    Block block;

    light_begin(&light);
    for (ulong first = item.begin; first < item.end; first += BLOCK) {
        const int count = (int)min(item.end - first, (ulong)(BLOCK)), vectors = (count + WIDTH - 1) / WIDTH;
        const bool others = block_trace(&block, scene, tables, &launch, &receiver, &sampler, first, count);
        ramps_add(&light, block.ramps[0], vectors, launch.window_columns, 0);
        ramps_add(&light, block.ramps[1], vectors, launch.window_rows, of_x);
        for (int j = 0; others && j < count; ++j) {
            const int fate = ((int *)block.fate)[j];
            if (fate != FATE_DETECTED) light_add(&light, bins + fate, 1);
        }
    }
    ramps_end(&light, launch.window_columns, 0);
    ramps_end(&light, launch.window_rows, of_x);
    light_end(&light);
}
