// Rays of a non-sequential trace. Each block has a list of rays; rays that end leave it, and it stays dense.
// Frame: world axes, with positions from the origin of a group (the mirror, the camera, the screen or a far element),
// so that coordinates stay small near each of them. Unit: mm.
#include "simd_*.cl"

// All fields of a ray: type of one lane, name. weight: remaining share of the emitted flux. path_*: six bits per event,
// the earliest in the highest bits (path_push). key: the ray's random word. last: the element that the ray stands on,
// or -1; before: the element it stood on before that, if the two touch, else -1. l1_norm: |x| + |y| + |z|.
#define RAY_FIELDS(DO) \
    DO(real, x) DO(real, y) DO(real, z) DO(real, dx) DO(real, dy) DO(real, dz) DO(real, weight) DO(real, l1_norm) \
    DO(uint, path_low) DO(uint, path_high) DO(uint, key) DO(int, group) DO(int, last) DO(int, before) DO(int, bounces)

#define realV realv
#define uintV uintv
#define intV intv
#define RAY_VECTOR(type, name) type##V name[BLOCK_VECTORS];
typedef struct { RAY_FIELDS(RAY_VECTOR) } Rays;

// Copies ray `from` of one list to place `to` of the same or another list.
INLINE void ray_copy(Rays *into, int to, const Rays *rays, int from) {
    #define RAY_COPY(type, name) ((type *)into->name)[to] = ((const type *)rays->name)[from];
    RAY_FIELDS(RAY_COPY)
    #undef RAY_COPY
}

INLINE bool any_lane(maskv mask) { return mask_word(mask) != 0; }
INLINE uint lanes_in(maskv mask) { return (uint)popcount(mask_word(mask)); }

// What happens at an element. Event and element number form one digit of the path; a path keeps its last ten digits.
enum { EVENT_NOMINAL, EVENT_GHOST, EVENT_SCATTER, EVENT_KINDS };
#define PATH_BITS 6

INLINE void path_push(uintv *low, uintv *high, uintv digit) {
    *high = *high << PATH_BITS | *low >> (32 - PATH_BITS);
    *low = *low << PATH_BITS | digit;
}

// A random word for one use at this point of a ray's path. It is a hash of use, path and key (with the finalizer of
// MurmurHash3), so it depends only on seed, replicate, source, ray, path and use.
INLINE uintv path_word(uintv key, uintv path_low, uintv path_high, uint use) {
    uintv word = key + path_low * 0x9E3779B1u + path_high * 0x85EBCA77u + use * 0xC2B2AE3Du;
    word = (word ^ word >> 16) * 0x85ebca6bu;
    word = (word ^ word >> 13) * 0xc2b2ae35u;
    return word ^ word >> 16;
}

INLINE realv magnitude(realv x) { return x < 0 ? -x : x; }
INLINE realv l1_norm_of(realv x, realv y, realv z) { return magnitude(x) + magnitude(y) + magnitude(z); }
