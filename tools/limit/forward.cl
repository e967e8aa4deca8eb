// The least work of a forward ray on the preset `sphere`: from a screen pixel to a point of the mirror's square, from
// there to the camera's aperture, and those that pass it onto the detector. Nothing that this scene does not need: the
// point on the mirror is drawn, not found; screen and camera are level; rays that fail are not told apart.
// Frame: the world. Unit: mm. limit_words: from words_*.cl; limit_count: from count_*.cl.
#include "simd_*.cl"

// The rays of a block where they cross the aperture.
typedef struct {
    wordv word[4][BLOCK / WORD_LANES];
    realv a[BLOCK_VECTORS], b[BLOCK_VECTORS], slope_a[BLOCK_VECTORS], slope_b[BLOCK_VECTORS];
    ulong through[BLOCK_VECTORS];
} LimitBlock;

// (-1/2, 1/2) of a whole word.
INLINE realv limit_uniform(const wordv *words, int v) { return to_real(as_intv(((const uintv *)words)[v])); }

INLINE void limit_trace(LimitBlock *block, const Limit *job, float pixel_x, float pixel_y, int v) {
    const float word = 0x1p-32f, radius2 = job->radius * job->radius, twice_inverse2 = 2 / radius2;
    const realv u = limit_uniform(block->word[0], v) * (word * job->pitch) + pixel_x;
    const realv t = limit_uniform(block->word[1], v) * (word * job->pitch) + pixel_y;
    const realv x = limit_uniform(block->word[2], v) * (2 * word * job->rim);
    const realv y = limit_uniform(block->word[3], v) * (2 * word * job->rim);
    const realv r2 = x * x + y * y, q2 = radius2 - r2, q = real_sqrt(q2), over = 1 / q;
    const realv z = job->radius - q, gx = x * over, gy = y * over;
    // incoming light, then the reflected, over the normal's third component
    const realv dx = x - (job->screen_x + u * job->screen_cos), dy = y - t;
    const realv dz = z - (job->screen_z + u * job->screen_sin);
    const realv turn = (dz - gx * dx - gy * dy) * q2 * twice_inverse2;
    const realv rx = dx + turn * gx, ry = dy + turn * gy, rz = dz - turn;
    const realv px = x - job->camera_x, pz = z - job->camera_z;
    const realv across = px * job->camera_cos + pz * job->camera_sin;
    const realv depth = pz * job->camera_cos - px * job->camera_sin;
    const realv inverse = 1 / (rz * job->camera_cos - rx * job->camera_sin);
    const realv slope_a = (rx * job->camera_cos + rz * job->camera_sin) * inverse, slope_b = ry * inverse;
    const realv a = across - depth * slope_a, b = y - depth * slope_b;
    block->a[v] = a;
    block->b[v] = b;
    block->slope_a[v] = slope_a;
    block->slope_b[v] = slope_b;
    block->through[v] = mask_word((a * a + b * b <= job->aperture2) & (r2 <= job->rim * job->rim));
}

// The detector pixel of a ray, or -1.
INLINE int limit_pixel(const LimitBlock *block, const Limit *job, int v, int lane) {
    const float a = ((const float *)&block->a[v])[lane], b = ((const float *)&block->b[v])[lane];
    const float slope_a = ((const float *)&block->slope_a[v])[lane];
    const float slope_b = ((const float *)&block->slope_b[v])[lane];
    const int column = (int)(a * job->of_position + slope_a * job->of_slope + job->middle);
    const int row = (int)(b * job->of_position + slope_b * job->of_slope + job->middle);
    const uint side = (uint)job->side;
    return (uint)column < side && (uint)row < side ? row * job->side + column : -1;
}

// From count_*.cl.
void limit_count(const LimitBlock *block, const Limit *job, __global uint *image);

// Parameters: places [sources]: of the screen pixels in their plane; images [sources, side * side]: counts.
// Grid: sources. rays: of each, a multiple of BLOCK. Assumes: images were zeroed.
__kernel void limit_forward(const Limit job, uint seed, uint rays, __global const float2 *places,
                            __global uint *images) {
    const uint source = get_global_id(0);
    const float2 place = places[source];
    __global uint *image = images + (size_t)source * job.side * job.side;
    LimitBlock block;
    for (uint first = 0; first < rays; first += BLOCK) {
        for (int k = 0; k < BLOCK / WORD_LANES; ++k) {
            wordv word[4];
            limit_words(first + k * WORD_LANES, source, seed, word);
            for (int d = 0; d < 4; ++d) block.word[d][k] = word[d];
        }
        for (int v = 0; v < BLOCK_VECTORS; ++v) limit_trace(&block, &job, place.x, place.y, v);
        limit_count(&block, &job, image);
    }
}
