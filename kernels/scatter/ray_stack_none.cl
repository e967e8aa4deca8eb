// Scenes whose rays never part: no list of rays that wait.
#include "ray.cl"

typedef struct { int waiting; } Spawned;

INLINE void spawn_begin(Spawned *spawned) { spawned->waiting = 0; }
INLINE int spawn_room(const Spawned *spawned) { return 0; }
INLINE uint spawn_lost(const Spawned *spawned) { return 0; }
INLINE int spawn_take(Spawned *spawned, Rays *rays, int count) { return count; }
