// The least work of an adjoint ray on the preset `sphere`: from a detector pixel through the aperture's square to the
// sphere, and where it lands on the screen, of which only the sums over a pixel's rays are kept. Frame: the world.
// Unit: mm. limit_words: from words_*.cl.
#include "simd_*.cl"

// Screen lines are counted from that far below the middle, so that a conversion that cuts rounds down.
#define LIMIT_BELOW 4096

typedef struct { intv rays, column, row; } LimitSums;

INLINE realv limit_uniform(const wordv *words, int v) { return to_real(as_intv(((const uintv *)words)[v])); }

INLINE void limit_trace(const wordv word[4][BLOCK / WORD_LANES], const Limit *job, float2 place, int v,
                        LimitSums *sums) {
    const float unit = 0x1p-32f;
    const realv a = limit_uniform(word[2], v) * (unit * job->aperture);
    const realv b = limit_uniform(word[3], v) * (unit * job->aperture);
    // on the plane in focus; the direction has that plane's distance along the camera's axis
    const realv u = limit_uniform(word[0], v) * (unit * job->pixel) + place.x - a;
    const realv t = limit_uniform(word[1], v) * (unit * job->pixel) + place.y - b;
    const realv dx = u * job->camera_cos + job->focus * job->camera_sin;
    const realv dz = u * job->camera_sin - job->focus * job->camera_cos;
    // from the sphere's centre
    const realv ox = a * job->camera_cos + job->camera_x, oz = a * job->camera_sin + (job->camera_z - job->radius);
    const realv square = dx * dx + t * t + dz * dz, along = ox * dx + b * t + oz * dz;
    const realv room = job->radius * job->radius - (ox * ox + b * b + oz * oz);
    const realv way = (real_sqrt(along * along + square * room) - along) / square;
    const realv hx = ox + way * dx, hy = b + way * t, hz = oz + way * dz;
    const realv turn = (dx * hx + t * hy + dz * hz) * (2 / (job->radius * job->radius));
    const realv rx = dx - turn * hx, ry = t - turn * hy, rz = dz - turn * hz;
    const realv ex = hx - job->screen_x, ez = hz + (job->radius - job->screen_z);
    const realv across = ex * job->screen_cos + ez * job->screen_sin;
    const realv depth = ez * job->screen_cos - ex * job->screen_sin;
    const realv over = depth / (rz * job->screen_cos - rx * job->screen_sin);
    const realv column = across - over * (rx * job->screen_cos + rz * job->screen_sin), row = hy - over * ry;
    const float middle = 0.5f + LIMIT_BELOW;
    const maskv ok = (a * a + b * b <= job->aperture2) & (hx * hx + hy * hy <= job->rim * job->rim);
    sums->rays -= ok;
    sums->column += to_int(column * job->lines + middle) & ok;
    sums->row += to_int(row * job->lines + middle) & ok;
}

// Parameters: places [sources]: of the detector pixels, on the plane in focus; sums [sources, 3]: rays that count, and
// their sums of screen columns and rows from the screen's middle.
// Grid: sources. rays: of each, a multiple of BLOCK, at most 2^18.
__kernel void limit_adjoint(const Limit job, uint seed, uint rays, __global const float2 *places, __global int *sums) {
    const uint source = get_global_id(0);
    const float2 place = places[source];
    LimitSums sum = {0, 0, 0};
    wordv words[4][BLOCK / WORD_LANES];
    for (uint first = 0; first < rays; first += BLOCK) {
        for (int k = 0; k < BLOCK / WORD_LANES; ++k) {
            wordv word[4];
            limit_words(first + k * WORD_LANES, source, seed, word);
            for (int d = 0; d < 4; ++d) words[d][k] = word[d];
        }
        for (int v = 0; v < BLOCK_VECTORS; ++v) limit_trace(words, &job, place, v, &sum);
    }
    const int count = (int)sum_lanes(sum.rays);
    sums[3 * source] = count;
    sums[3 * source + 1] = (int)((long)sum_lanes(sum.column) - (long)count * LIMIT_BELOW);
    sums[3 * source + 2] = (int)((long)sum_lanes(sum.row) - (long)count * LIMIT_BELOW);
}
