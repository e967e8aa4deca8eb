// Rays that parted from others and wait until the list of the block has room.
#include "ray.cl"

typedef struct { Rays of[STACK_BLOCKS]; int waiting; uint lost; } RayStack;

INLINE void stack_begin(RayStack *stack) {
    stack->waiting = 0;
    stack->lost = 0;
}

// Whether rays may part that could be followed by probability instead: half of the list is kept for those that scatter.
INLINE int stack_room(const RayStack *stack) { return stack->waiting <= STACK_BLOCKS * BLOCK / 2; }

// Adds a copy of ray `from`, one event later, and returns the list and the place where it stands, for the caller to
// change; in a full list it takes the place of another, which is lost and counted.
INLINE Rays *stack_push(RayStack *stack, const Rays *rays, int from, int *place) {
    if (stack->waiting == STACK_BLOCKS * BLOCK) {
        ++stack->lost;
        --stack->waiting;
    }
    Rays *into = &stack->of[stack->waiting / BLOCK];
    *place = stack->waiting++ % BLOCK;
    ray_copy(into, *place, rays, from);
    ++((int *)into->bounces)[*place];
    return into;
}

INLINE uint stack_lost(const RayStack *stack) { return stack->lost; }

// Moves waiting rays behind the first `count` of the block's list, as far as there is room; returns the new count.
INLINE int stack_pop(RayStack *stack, Rays *rays, int count) {
    while (stack->waiting > 0 && count < BLOCK) {
        --stack->waiting;
        ray_copy(rays, count++, &stack->of[stack->waiting / BLOCK], stack->waiting % BLOCK);
    }
    return count;
}
