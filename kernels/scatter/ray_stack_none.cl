// No ray stack: for scenes whose rays never split. The same verbs as ray_stack_list.cl.
#include "ray.cl"

typedef struct { int waiting; } RayStack;

INLINE void stack_begin(RayStack *stack) { stack->waiting = 0; }
INLINE int stack_room(const RayStack *stack) { return 0; }
INLINE uint stack_lost(const RayStack *stack) { return 0; }
INLINE int stack_pop(RayStack *stack, Rays *rays, int count) { return count; }
