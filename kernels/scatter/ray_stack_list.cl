// The ray stack: rays that split from others and wait until the block's list has room.
#include "ray.cl"

typedef struct { Rays of[STACK_BLOCKS]; int waiting; uint lost; } RayStack;

INLINE void stack_begin(RayStack *stack) {
    stack->waiting = 0;
    stack->lost = 0;
}

// Whether both branches of a ray may be followed: half of the stack is reserved for rays that scatter.
INLINE int stack_room(const RayStack *stack) { return stack->waiting <= STACK_BLOCKS * BLOCK / 2; }

// Adds a copy of ray `from` with one more bounce. Returns the block and sets the place where the copy stands, so that
// the caller can change it. In a full stack it replaces another ray, which is counted as lost.
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

// Moves waiting rays to the end of the block's list of `count` rays while there is room; returns the new count.
INLINE int stack_pop(RayStack *stack, Rays *rays, int count) {
    while (stack->waiting > 0 && count < BLOCK) {
        --stack->waiting;
        ray_copy(rays, count++, &stack->of[stack->waiting / BLOCK], stack->waiting % BLOCK);
    }
    return count;
}
