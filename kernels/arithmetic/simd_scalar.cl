// Scalar types for GPUs: one ray per work-item. The same verbs as simd_vector.cl.
#include "real_*.cl"

#define INLINE inline
#define WIDTH 1

typedef REAL real;
typedef REAL realv;
typedef int maskv;                        // 0 or 1, as a comparison returns it
typedef int intv;
typedef uint uintv;
typedef struct { realv x, y, z; } vec3v;

#define WORD_LANES 1
typedef uint wordv;

#define BLOCK 1                           // nothing to compact: a work-item bins each ray immediately
#define BLOCK_VECTORS 1
#define STACK_BLOCKS 16                   // capacity of the ray stack in blocks

#define to_real(v) ((real)(v))
#define to_int(v) ((int)(v))
#define to_mask(v) ((int)(v))
#define as_intv(v) as_int(v)
#define as_uintv(v) as_uint(v)

INLINE uintv lane_index(void) { return 0; }
INLINE wordv word_index(void) { return 0; }

INLINE realv real_sqrt(realv x) { return sqrt(x); }

INLINE intv count_mask(intv counts, maskv mask) { return counts + mask; }
INLINE uint count_lanes(intv counts) { return (uint)counts; }

INLINE ulong sum_lanes(intv a) { return (ulong)a; }

INLINE ulong mask_word(maskv mask) { return mask; }
#define ALL_LANES 1UL
#define LANE_PARTS 1
#define LANE_PART 1UL
#define LANE_PAIRS 1
INLINE ulong pair_bits(uintv bits, int pair) { return bits; }
INLINE int lowest_bit(ulong word) { return 0; }
INLINE int lowest_lane(ulong word) { return 0; }

INLINE wordv reverse_bits(wordv x) {
    x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
    x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
    x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
    x = (x >> 8 & 0x00ff00ffu) | (x & 0x00ff00ffu) << 8;
    return x >> 16 | x << 16;
}

INLINE void multiply_wide(wordv a, uint b, wordv *high, wordv *low) {
    *high = mul_hi(a, b);
    *low = a * b;
}
