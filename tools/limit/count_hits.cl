// Counts the rays of a block that passed the aperture by detector pixel.
INLINE void limit_count(const LimitBlock *block, const Limit *job, __global uint *image) {
    for (int v = 0; v < BLOCK_VECTORS; ++v)
        for (ulong lanes = block->through[v]; lanes != 0; lanes &= lanes - 1) {
            const int pixel = limit_pixel(block, job, v, lowest_lane(lanes));
            if (pixel >= 0) ++image[pixel];
        }
}
