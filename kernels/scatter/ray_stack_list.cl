// Rays that parted from others and wait until the list of the block has room.
#include "ray.cl"

typedef struct { Rays of[SPAWN_BLOCKS]; int waiting; uint lost; } Spawned;

INLINE void spawn_begin(Spawned *spawned) {
    spawned->waiting = 0;
    spawned->lost = 0;
}

// Whether rays may part that could be followed by chance instead: half of the list is kept for those that scatter.
INLINE int spawn_room(const Spawned *spawned) { return spawned->waiting <= SPAWN_BLOCKS * BLOCK / 2; }

// Adds a copy of ray `from`, one event later, and returns the list and the place where it stands, for the caller to
// change; in a full list it takes the place of another, which is lost and counted.
INLINE Rays *spawn_copy(Spawned *spawned, const Rays *rays, int from, int *place) {
    if (spawned->waiting == SPAWN_BLOCKS * BLOCK) {
        ++spawned->lost;
        --spawned->waiting;
    }
    Rays *into = &spawned->of[spawned->waiting / BLOCK];
    *place = spawned->waiting++ % BLOCK;
    ray_copy(into, *place, rays, from);
    ++((int *)into->bounces)[*place];
    return into;
}

INLINE uint spawn_lost(const Spawned *spawned) { return spawned->lost; }

// Moves waiting rays behind the first `count` of the block's list, as far as there is room; returns the new count.
INLINE int spawn_take(Spawned *spawned, Rays *rays, int count) {
    while (spawned->waiting > 0 && count < BLOCK) {
        --spawned->waiting;
        ray_copy(rays, count++, &spawned->of[spawned->waiting / BLOCK], spawned->waiting % BLOCK);
    }
    return count;
}
