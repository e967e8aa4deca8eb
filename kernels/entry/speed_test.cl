// Speed test: a small job of the kind that all kernels do, for choosing between drivers of the same processor.
// irtscots_cl/opencl/speed.py runs it. Rays of a block get random words, are aimed into a disk, meet a sphere, are
// reflected and counted by detector pixel where they pass an aperture.
#include "philox.cl"
#include "uniform.cl"

#define SIDE 64      // of the square detector, in pixels
#define RADIUS (real)100

typedef struct { realv x, y, u, v; } Spot;
typedef struct { wordv of[4][BLOCK / WORD_LANES]; } SpotWords;   // [dimension][ray]

INLINE uintv spot_words(const SpotWords *words, int dimension, int v) { return ((const uintv *)words->of[dimension])[v]; }

// Passes as in the tracing kernels: words, aims, meeting and reflection, each a short loop over the block.
INLINE void block_words(uint first, uint source, SpotWords *words) {
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
        const Philox counter = {{first + v * WORD_LANES + word_index(), (wordv)(0), (wordv)(source), (wordv)(0)}};
        const Philox out = philox4x32_10(counter, 1, 2);
        for (int d = 0; d < 4; ++d) words->of[d][v] = out.word[d];
    }
}

INLINE void block_aim(const SpotWords *words, Spot *spots) {
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        unit_disk(spot_words(words, 0, v), spot_words(words, 1, v), &spots[v].u, &spots[v].v);
        spots[v].x = uniform_centred(spot_words(words, 2, v));
        spots[v].y = uniform_centred(spot_words(words, 3, v));
    }
}

// A ray from (x, y, 2 RADIUS) along (u, v, -10), reflected by the sphere x^2 + y^2 + z^2 = 2 RADIUS z and followed back
// to its height: where it arrives, and its slopes. Returns the lanes that pass the aperture.
INLINE ulong sphere_reflect(Spot *spot) {
    const realv p = spot->u * (real)-0.1, q = spot->v * (real)-0.1;
    const realv x0 = spot->x - p * (2 * RADIUS), y0 = spot->y - q * (2 * RADIUS);
    const realv c = (x0 * x0 + y0 * y0) / RADIUS, b = 1 - (x0 * p + y0 * q) / RADIUS;
    const realv z = c / (b + real_sqrt(b * b - (p * p + q * q + 1) * c / RADIUS));
    const realv x = x0 + p * z, y = y0 + q * z, nx = -x / RADIUS, ny = -y / RADIUS, nz = 1 - z / RADIUS;
    const realv twice = 2 * (p * nx + q * ny + nz), inverse = 1 / (twice * nz - 1);
    spot->u = (twice * nx - p) * inverse;
    spot->v = (twice * ny - q) * inverse;
    spot->x = x + spot->u * (2 * RADIUS - z);
    spot->y = y + spot->v * (2 * RADIUS - z);
    return mask_word(spot->x * spot->x + spot->y * spot->y <= (real)50);
}

// Parameters: blocks of rays for each work-item; counts [grid 0][SIDE * SIDE]; tile [SIDE * SIDE], local.
// Grid: (any number of work-items, 1).
__kernel void speed_test(const uint blocks, __global uint *counts, __local uint *tile) {
    const uint source = get_global_id(0);
    SpotWords words;
    Spot spots[BLOCK_VECTORS];
    ulong through[BLOCK_VECTORS];
    for (int pixel = 0; pixel < SIDE * SIDE; ++pixel) tile[pixel] = 0;
    for (uint block = 0; block < blocks; ++block) {
        block_words(block * BLOCK, source, &words);
        block_aim(&words, spots);
        for (int v = 0; v < BLOCK_VECTORS; ++v) through[v] = sphere_reflect(&spots[v]);
        for (int v = 0; v < BLOCK_VECTORS; ++v)
            for (ulong lanes = through[v]; lanes != 0; lanes &= lanes - 1) {
                const int lane = lowest_lane(lanes);
                const int column = ((const real *)&spots[v].x)[lane] + SIDE / 2,
                          row = ((const real *)&spots[v].y)[lane] + SIDE / 2;
                if (column >= 0 && column < SIDE && row >= 0 && row < SIDE) ++tile[row * SIDE + column];
            }
    }
    for (int pixel = 0; pixel < SIDE * SIDE; ++pixel) counts[source * SIDE * SIDE + pixel] = tile[pixel];
}
