// Vector types for CPUs: WIDTH rays side by side in one work-item (a build option: 8 or 16). BLOCK, the rays between two
// compactions, is a build option, too.
//
// Only operators and compiler builtins are used on vectors, never library functions. Some CPU drivers build their
// function library for another instruction set than the kernels, so a 512-bit argument would be passed in the wrong
// registers. All CPU drivers use Clang, and these are its vector types.
#pragma clang diagnostic ignored "-Wpsabi"   // no vector is ever passed to a call here
#include "real_*.cl"

#define INLINE inline __attribute__((always_inline))   // a real call would pass vectors through memory

typedef REAL real;
typedef REAL realv __attribute__((ext_vector_type(WIDTH)));
typedef MASK maskv __attribute__((ext_vector_type(WIDTH)));   // 0 or -1 per lane, as a comparison returns it
typedef int intv __attribute__((ext_vector_type(WIDTH)));
typedef uint uintv __attribute__((ext_vector_type(WIDTH)));
typedef struct { realv x, y, z; } vec3v;

// Random words have their own width: working on two registers at once hides the multiplier's latency.
#define WORD_LANES 16
typedef uint16 wordv;

#define BLOCK_VECTORS (BLOCK / WIDTH)

#define to_real(v) __builtin_convertvector(v, realv)
#define to_int(v) __builtin_convertvector(v, intv)
#define to_mask(v) __builtin_convertvector(v, maskv)
#define as_intv(v) __builtin_astype(v, intv)
#define as_uintv(v) __builtin_astype(v, uintv)

__constant uint lane_numbers[16] __attribute__((aligned(64))) = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

INLINE uintv lane_index(void) { return *(__constant uintv *)lane_numbers; }
INLINE wordv word_index(void) { return *(__constant wordv *)lane_numbers; }

#define STACK_BLOCKS 8   // capacity of the ray stack in blocks (ray_stack_list.cl)

// Correctly rounded square root: one hardware instruction per register. Where the compiler has no builtin for vectors it
// joins the lanes' roots itself (LLVM 14), of several registers only in an unrolled loop: else they go through memory.
// Where it has one it may leave them apart (Intel's).
#if __has_builtin(__builtin_elementwise_sqrt)
INLINE realv real_sqrt(realv x) { return __builtin_elementwise_sqrt(x); }
#else
INLINE realv real_sqrt(realv x) {
    realv root;
    #pragma unroll
    for (int i = 0; i < WIDTH; ++i) ((real *)&root)[i] = real_sqrt_scalar(((real *)&x)[i]);
    return root;
}
#endif

// Counts the set lanes of masks: sums per lane, then over the lanes.
INLINE intv count_mask(intv counts, maskv mask) { return counts - to_int(mask); }

INLINE uint count_lanes(intv counts) {
    uint count = 0;
    for (int i = 0; i < WIDTH; ++i) count += ((int *)&counts)[i];
    return count;
}

// Sum over the lanes, for numbers from 0 to 2^31 - 1.
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

// The bits of two neighbouring lanes: 32 of lane 2 * pair, then 32 of the next. Few of many bits are found faster in
// long words: a loop over them ends less often, and its end is what a processor cannot predict.
#define LANE_PAIRS (WIDTH / 2)
INLINE ulong pair_bits(uintv bits, int pair) { return ((const ulong *)&bits)[pair]; }

INLINE int lowest_bit(ulong word) { return __builtin_ctzl(word); }

INLINE int lowest_lane(ulong word) {
    const int bit = lowest_bit(word);
    return bit / 8 + bit % 8 * 8;
}

// Exchanges lanes i and i ^ k; swap: all lanes' masks of k's bits.
#define LANE_BITS (WIDTH == 8 ? 3 : 4)
INLINE uintv swap_lanes(uintv x, const intv swap[LANE_BITS]) {
    #pragma unroll
    for (int bit = 0; bit < LANE_BITS; ++bit) {
        uintv other;
        #pragma unroll
        for (int i = 0; i < WIDTH; ++i) ((uint *)&other)[i] = ((const uint *)&x)[i ^ 1 << bit];
        x = swap[bit] ? other : x;
    }
    return x;
}

// The bits of each word in reverse order.
#if __has_builtin(__builtin_elementwise_bitreverse)
INLINE wordv reverse_bits(wordv x) { return __builtin_elementwise_bitreverse(x); }
#else
INLINE wordv reverse_bits(wordv x) {
    wordv reversed;
    for (int i = 0; i < WORD_LANES; ++i) ((uint *)&reversed)[i] = __builtin_bitreverse32(((uint *)&x)[i]);
    return reversed;
}
#endif

// 32 x 32 -> 64 bit products. Even and odd lanes are multiplied separately, which is one hardware instruction each; a
// vector mul_hi would run lane by lane.
INLINE void multiply_wide(wordv a, uint b, wordv *high, wordv *low) {
    const ulong8 pairs = as_ulong8(a);
    const ulong8 factor = (ulong8)((ulong)b);
    const ulong8 low_word = (ulong8)(0xffffffffUL);
    const ulong8 even = (pairs & low_word) * factor;
    const ulong8 odd = (pairs >> 32) * factor;
    *high = as_uint16((even >> 32) | (odd & ~low_word));
    *low = as_uint16((even & low_word) | (odd << 32));
}
