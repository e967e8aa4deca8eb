// Adjoint estimator: rays leave a detector pixel through the aperture and are summed where they reach the screen.
// Frames and stages as in path_adjoint.cl. Unit: mm.
#include "work_item.cl"
#include "path_adjoint.cl"
#include "accumulate_*.cl"

// A block of rays between its passes. trace_forward.cl says why the passes are short.
typedef struct {
    Words words;
    Line lines[BLOCK_VECTORS];
    Meeting meetings[BLOCK_VECTORS];
    realv weight[BLOCK_VECTORS];
    intv bin[BLOCK_VECTORS], amount[BLOCK_VECTORS];
} Block;

// The bin of a ray: a bin of the window, or the bin of its fate. Fate bins follow the window's.
INLINE maskv ray_bin(__constant Scene *scene, const Launch *launch, const Receiver *receiver, const Line *line,
                     const Meeting *met) {
    realv u, v;
    const maskv ahead = adjoint_arrive(scene, receiver, line, met, &u, &v);
    const int columns = launch->window_columns, rows = launch->window_rows, fates = columns * rows;
    const realv x = u * scene->inverse_screen_pitch_x + (scene->screen_left - receiver->column);
    const realv y = v * scene->inverse_screen_pitch_y + (scene->screen_top - receiver->row);
    const maskv in_window = ahead & (x >= 0) & (y >= 0) & (x < columns) & (y < rows);
    const maskv on_screen = ahead & (x >= -receiver->column) & (x < launch->screen_columns - receiver->column)
                            & (y >= -receiver->row) & (y < launch->screen_rows - receiver->row);
    const maskv inside = to_mask(to_int(y)) * columns + to_mask(to_int(x));
    maskv bin = on_screen ? (maskv)(fates + FATE_OFF_WINDOW) : (maskv)(fates + FATE_OFF_SCREEN);
    bin = in_window ? inside : bin;
    bin = u != u ? (maskv)(fates + FATE_FAILED) : bin;
    return met->on_mirror ? bin : (maskv)(fates + FATE_MISSED_MIRROR);
}

// First passes, branch-free: bins and amounts of a block of rays. A ray counts as one in a fate's bin.
INLINE void block_trace(Block *block, __constant Scene *scene, __global const real *tables, const Launch *launch,
                        const Receiver *receiver, Sampler *sampler, ulong first) {
    const int window_bins = launch->window_columns * launch->window_rows;
    sampler_block(sampler, first, &block->words);
    for (int v = 0; v < BLOCK_VECTORS; ++v)
        block->lines[v] = adjoint_emit(scene, receiver, &block->words, v, &block->weight[v]);
    for (int v = 0; v < BLOCK_VECTORS; ++v) block->meetings[v] = mirror_meet(scene, tables, &block->lines[v]);
    for (int v = 0; v < BLOCK_VECTORS; ++v) mirror_deviate(scene, tables, &block->lines[v], &block->meetings[v]);
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const intv bin = to_int(ray_bin(scene, launch, receiver, &block->lines[v], &block->meetings[v]));
        const intv amount = to_int(block->weight[v] * receiver->weight_scale + (real)0.5);
        block->bin[v] = bin;
        block->amount[v] = bin < window_bins ? amount : (intv)(1);
    }
}

// Parameters: tables: of the mirror, where a file of its kind reads any; receivers [visible pixels]; transport, ledger:
// 64-bit sums.
// Grid: (visible pixels of this launch, runs of its rays). A work-item traces rays_per_item rays of one detector pixel.
// Assumes: transport and ledger were zeroed before the replicate's first launch; windows lie inside the screen.
__kernel void trace_adjoint(__constant Scene *scene, const Launch launch, __global const real *tables,
                            __global const Receiver *receivers, __global uint *transport, __global uint *ledger,
                            __local ulong *tile) {
    const WorkItem item = work_item(&launch);
    const uint visible_pixel = item.source;
    const Receiver receiver = receivers[visible_pixel];
    const int window_bins = launch.window_columns * launch.window_rows;
    Light light = {transport + 2 * (size_t)visible_pixel * window_bins, ledger, tile, window_bins,
                   window_bins + FATE_COUNT};
    Sampler sampler;
    sampler_begin(&sampler, &launch, receiver.pixel);
    Block block;

    light_begin(&light);
    for (ulong first = item.begin; first < item.end; first += BLOCK) {
        const int count = (int)min(item.end - first, (ulong)(BLOCK));
        block_trace(&block, scene, tables, &launch, &receiver, &sampler, first);
        for (int j = 0; j < count; ++j) light_add(&light, ((int *)block.bin)[j], ((int *)block.amount)[j]);
    }
    light_end(&light);
}
