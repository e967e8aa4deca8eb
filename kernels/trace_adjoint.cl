// Adjoint estimator: rays leave a detector pixel through the aperture and are summed where they reach the screen.
#include "path_adjoint.cl"
#include "accumulate_*.cl"

// A block of rays between its two passes.
typedef struct { intv bin[BLOCK_VECTORS], weight[BLOCK_VECTORS]; } Block;

// The bin of a path: in the window, or the fate's behind it.
INLINE maskv path_bin(__constant Scene *scene, const Launch *launch, const Receiver *receiver, const PathAdjoint *path) {
    const int columns = launch->window_columns, rows = launch->window_rows, fates = columns * rows;
    const realv x = path->u * scene->inverse_screen_pitch + (scene->screen_left - receiver->column);
    const realv y = path->v * scene->inverse_screen_pitch + (scene->screen_top - receiver->row);
    const maskv in_window = path->ahead & (x >= 0) & (y >= 0) & (x < columns) & (y < rows);
    const maskv on_screen = path->ahead & (x >= -receiver->column) & (x < launch->screen_columns - receiver->column)
                            & (y >= -receiver->row) & (y < launch->screen_rows - receiver->row);
    const maskv failed = path->u != path->u;
    const maskv inside = to_mask(to_int(y)) * columns + to_mask(to_int(x));
    maskv bin = on_screen ? (maskv)(fates + FATE_OFF_WINDOW) : (maskv)(fates + FATE_OFF_SCREEN);
    bin = in_window ? inside : bin;
    bin = failed ? (maskv)(fates + FATE_FAILED) : bin;
    return path->on_mirror ? bin : (maskv)(fates + FATE_MISSED_MIRROR);
}

// First pass, branch-free: bins and weights of a block of rays. Rays count as one in the bins of the fates.
INLINE void block_trace(Block *block, __constant Scene *scene, const Launch *launch, const Receiver *receiver,
                        uint stream, ulong first) {
    const int window_bins = launch->window_columns * launch->window_rows;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const Philox words = sample_words(launch, stream, first + v * WIDTH);
        const PathAdjoint path = path_adjoint(scene, receiver->x, receiver->y, words);
        const intv bin = to_int(path_bin(scene, launch, receiver, &path));
        const intv weight = to_int(path.weight * receiver->weight_scale + (real)0.5);
        block->bin[v] = bin;
        block->weight[v] = bin < window_bins ? weight : (intv)(1);
    }
}

// Parameters: receivers [slots]; transport, ledger: 64-bit sums.
// Grid: (slots of this launch, parts of its rays). A work-item traces rays_per_item rays of one detector pixel.
// Assumes: transport and ledger zeroed before the replicate's first launch; windows lie inside the screen.
__kernel void trace_adjoint(__constant Scene *scene, const Launch launch, __global const Receiver *receivers,
                            __global uint *transport, __global uint *ledger, __local ulong *tile) {
    const uint slot = launch.first_stream + get_global_id(0);
    const ulong begin = launch.first_ray + get_global_id(1) * launch.rays_per_item;
    const ulong end = min(begin + launch.rays_per_item, launch.first_ray + launch.ray_count);
    const Receiver receiver = receivers[slot];
    const int window_bins = launch.window_columns * launch.window_rows;
    Light light = {transport + 2 * (size_t)slot * window_bins, ledger, tile, window_bins, window_bins + FATE_COUNT};
    Block block;

    light_begin(&light);
    for (ulong first = begin; first < end; first += BLOCK_VECTORS * WIDTH) {
        const int count = (int)min(end - first, (ulong)(BLOCK_VECTORS * WIDTH));
        block_trace(&block, scene, &launch, &receiver, receiver.pixel, first);
        for (int j = 0; j < count; ++j) light_add(&light, ((int *)block.bin)[j], ((int *)block.weight)[j]);
    }
    light_end(&light);
}
