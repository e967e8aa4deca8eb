// Vector types for CPUs: WIDTH rays side by side in one work-item (a build option: 8 or 16).
//
// Only operators and the compiler's own builtins are used on vectors, never library functions: some CPU drivers ship
// their function library for another instruction set than the one they compile kernels for, and a 512-bit argument
// then crosses that border in the wrong registers. CPU drivers all use Clang, whose vector types these are.
#pragma clang diagnostic ignored "-Wpsabi"   // for the same reason: no vector ever crosses a call here
#include "real_*.cl"

#define INLINE inline __attribute__((always_inline))   // a helper that is called gets its vectors through memory

typedef REAL real;
typedef REAL realv __attribute__((ext_vector_type(WIDTH)));
typedef MASK maskv __attribute__((ext_vector_type(WIDTH)));   // 0 or -1 per lane, as comparisons give it
typedef int intv __attribute__((ext_vector_type(WIDTH)));
typedef uint uintv __attribute__((ext_vector_type(WIDTH)));
typedef struct { realv x, y, z; } vec3v;

// Random words have their own width: two registers side by side hide the multiplier's latency.
#define WORD_LANES 16
typedef uint16 wordv;

// Rays between two compactions. All that is kept of a block (22 KiB) fits the L1 cache.
#define BLOCK 256
#define BLOCK_VECTORS (BLOCK / WIDTH)

#define to_real(v) __builtin_convertvector(v, realv)
#define to_int(v) __builtin_convertvector(v, intv)
#define to_mask(v) __builtin_convertvector(v, maskv)
#define as_intv(v) __builtin_astype(v, intv)
#define as_uintv(v) __builtin_astype(v, uintv)

__constant uint lane_numbers[16] __attribute__((aligned(64))) = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

INLINE uintv lane_index(void) { return *(__constant uintv *)lane_numbers; }
INLINE wordv word_index(void) { return *(__constant wordv *)lane_numbers; }

#define STACK_BLOCKS 8   // that a block of rays can leave waiting (ray_stack_list.cl)

// Correctly rounded square root: one hardware instruction per register once the compiler has joined the lanes.
INLINE realv real_sqrt(realv x) {
    realv root;
    for (int i = 0; i < WIDTH; ++i) ((real *)&root)[i] = real_sqrt_scalar(((real *)&x)[i]);
    return root;
}

// Counts the set lanes of masks: sums per lane, then over the lanes.
INLINE intv count_mask(intv counts, maskv mask) { return counts - to_int(mask); }

INLINE uint count_lanes(intv counts) {
    uint count = 0;
    for (int i = 0; i < WIDTH; ++i) count += ((int *)&counts)[i];
    return count;
}

// The sum over the lanes of numbers from 0 to 2^31 - 1.
INLINE ulong sum_lanes(intv a) {
    ulong sum = 0;
    for (int i = 0; i < WIDTH; ++i) sum += (uint)((int *)&a)[i];
    return sum;
}

// A mask as one scalar with one set bit per set lane: lane j has bit j / 8 of byte j % 8.
typedef char lane_bytes __attribute__((ext_vector_type(WIDTH)));

INLINE ulong mask_word(maskv mask) {
    const lane_bytes bytes = __builtin_convertvector(mask, lane_bytes);
    ulong word = 0;
    for (int part = 0; part < WIDTH / 8; ++part) word |= (((const ulong *)&bytes)[part] & 0x0101010101010101UL) << part;
    return word;
}

// The lanes of a mask word in ascending order: 8 * p ... 8 * p + 7 are the bits of word >> p & LANE_PART.
#define LANE_PARTS (WIDTH / 8)
#define LANE_PART 0x0101010101010101UL
#define ALL_LANES (0x0101010101010101UL * ((1 << WIDTH / 8) - 1))   // mask_word of a full mask

INLINE int lowest_lane(ulong word) {
    const int bit = __builtin_ctzl(word);
    return bit / 8 + bit % 8 * 8;
}

// The words' bits in opposite order.
INLINE wordv reverse_bits(wordv x) {
    wordv reversed;
    for (int i = 0; i < WORD_LANES; ++i) ((uint *)&reversed)[i] = __builtin_bitreverse32(((uint *)&x)[i]);
    return reversed;
}

// 32 x 32 -> 64 bit products. Even and odd lanes are multiplied apart: that is the hardware's own instruction, while a
// vector mul_hi would be taken lane by lane.
INLINE void multiply_wide(wordv a, uint b, wordv *high, wordv *low) {
    const ulong8 pairs = as_ulong8(a);
    const ulong8 factor = (ulong8)((ulong)b);
    const ulong8 low_word = (ulong8)(0xffffffffUL);
    const ulong8 even = (pairs & low_word) * factor;
    const ulong8 odd = (pairs >> 32) * factor;
    *high = as_uint16((even >> 32) | (odd & ~low_word));
    *low = as_uint16((even & low_word) | (odd << 32));
}
