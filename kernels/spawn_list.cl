// Rays that parted from others and wait until the list of the block has room.
#include "ray.cl"

typedef struct { Rays rays; int waiting, lost; } Spawned;

INLINE void spawn_begin(Spawned *spawned) { spawned->waiting = spawned->lost = 0; }

// Adds a copy of a ray, for the caller to change, and returns its place; in a full list it takes the place of
// another, which is lost and counted: the host makes it an error.
INLINE int spawn_copy(Spawned *spawned, const Rays *rays, int from) {
    if (spawned->waiting == BLOCK) {
        ++spawned->lost;
        --spawned->waiting;
    }
    const int place = spawned->waiting++;
    ray_copy(&spawned->rays, place, rays, from);
    return place;
}

INLINE uint spawn_lost(const Spawned *spawned) { return spawned->lost; }

// Moves waiting rays behind the first `count` of the block's list, as far as there is room; returns the new count.
INLINE int spawn_take(Spawned *spawned, Rays *rays, int count) {
    while (spawned->waiting > 0 && count < BLOCK) ray_copy(rays, count++, &spawned->rays, --spawned->waiting);
    return count;
}
