// Rays of a non-sequential trace. Each block has a list of rays; rays that end leave it, and it stays dense.
// Frame: world axes, with positions from the origin of a group (the mirror, the camera, the screen or a far element),
// so that coordinates stay small near each of them. Unit: mm.
#include "path_code.cl"
#include "light_*.cl"

// All fields of a ray: type of one lane, name. weight: remaining share of the emitted flux. key: the ray's random
// word. last: the element that the ray stands on,
// or -1; before: the element it stood on before that, if the two touch, else -1. l1_norm: |x| + |y| + |z|.
#define RAY_FIELDS(DO) \
    DO(real, x) DO(real, y) DO(real, z) DO(real, dx) DO(real, dy) DO(real, dz) DO(real, weight) DO(real, l1_norm) \
    DO(uint, key) DO(int, group) DO(int, last) DO(int, before) DO(int, bounces) LIGHT_FIELDS(DO)

#define realV realv
#define uintV uintv
#define intV intv
#define RAY_VECTOR(type, name) type##V name[BLOCK_VECTORS];
typedef struct { RAY_FIELDS(RAY_VECTOR) uintv path[PATH_WORDS][BLOCK_VECTORS]; } Rays;

// Copies ray `from` of one list to place `to` of the same or another list.
INLINE void ray_copy(Rays *into, int to, const Rays *rays, int from) {
    #define RAY_COPY(type, name) ((type *)into->name)[to] = ((const type *)rays->name)[from];
    RAY_FIELDS(RAY_COPY)
    #undef RAY_COPY
    for (int w = 0; w < PATH_WORDS; ++w) ((uint *)into->path[w])[to] = ((const uint *)rays->path[w])[from];
}

// The path of the rays of vector v.
INLINE PathCode path_of(const Rays *rays, int v) {
    PathCode path;
    for (int w = 0; w < PATH_WORDS; ++w) path.word[w] = rays->path[w][v];
    return path;
}

INLINE bool any_lane(maskv mask) { return mask_word(mask) != 0; }
INLINE uint lanes_in(maskv mask) { return (uint)popcount(mask_word(mask)); }

// What happens at an element.
enum { EVENT_NOMINAL, EVENT_GHOST, EVENT_SCATTER, EVENT_KINDS };

INLINE realv magnitude(realv x) { return x < 0 ? -x : x; }
INLINE realv l1_norm_of(realv x, realv y, realv z) { return magnitude(x) + magnitude(y) + magnitude(z); }
