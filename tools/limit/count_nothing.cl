// Finds the detector pixels of the rays of a block that passed the aperture, but counts nothing.
INLINE void limit_count(const LimitBlock *block, const Limit *job, __global uint *image) {
    int all = 0;
    for (int v = 0; v < BLOCK_VECTORS; ++v)
        for (ulong lanes = block->through[v]; lanes != 0; lanes &= lanes - 1)
            all |= limit_pixel(block, job, v, lowest_lane(lanes));
    if (all == -2) ++image[0];   // never, but no compiler knows
}
