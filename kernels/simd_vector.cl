// Vector types for CPUs: WIDTH rays side by side in one work-item (WIDTH = 4, 8 or 16, HALF = WIDTH / 2: build options).
//
// Only operators and per-lane compiler builtins are used on vectors, never library functions: some CPU drivers ship
// their function library for another instruction set than the one they compile kernels for, and a 512-bit argument
// then crosses that border by the wrong registers.
#include "real_*.cl"

// A helper that is not inlined hands vectors over through memory: half the speed.
#define INLINE inline __attribute__((always_inline))

#define CONCATENATE_(a, b) a##b
#define CONCATENATE(a, b) CONCATENATE_(a, b)

typedef REAL real;
typedef CONCATENATE(REAL, WIDTH) realv;
typedef CONCATENATE(MASK, WIDTH) maskv;   // 0 or -1 per lane, as the comparison operators give it
typedef CONCATENATE(int, WIDTH) intv;
typedef CONCATENATE(uint, WIDTH) uintv;
typedef CONCATENATE(ulong, HALF) wide;     // the same register seen as half as many 64-bit lanes

#define BLOCK_VECTORS (512 / WIDTH)       // rays between two compactions: 512, so that a block stays in the L1 cache

#define to_real(v) __builtin_convertvector(v, realv)
#define to_int(v) __builtin_convertvector(v, intv)
#define to_uint(v) __builtin_convertvector(v, uintv)
#define to_mask(v) __builtin_convertvector(v, maskv)

#define as_intv(v) CONCATENATE(as_int, WIDTH)(v)
#define as_uintv(v) CONCATENATE(as_uint, WIDTH)(v)
#define as_wide(v) CONCATENATE(as_ulong, HALF)(v)

// Lane numbers 0, 1, ... WIDTH - 1.
INLINE uintv lane_index(void) {
    uintv lane;
    for (int i = 0; i < WIDTH; ++i) ((uint *)&lane)[i] = i;
    return lane;
}

// Correctly rounded square root: one hardware instruction per register once the compiler has joined the lanes.
INLINE realv real_sqrt(realv x) {
    realv root;
    for (int i = 0; i < WIDTH; ++i) ((real *)&root)[i] = real_sqrt_scalar(((real *)&x)[i]);
    return root;
}

typedef struct { realv x, y, z; } vec3v;

// How many lanes are set. masks: lane-wise sums of masks, each lane in [-2^31, 0].
INLINE uint count_lanes(intv masks) {
    uint count = 0;
    for (int i = 0; i < WIDTH; ++i) count -= ((int *)&masks)[i];
    return count;
}

// 32 x 32 -> 64 bit products. Even and odd lanes are multiplied apart: that is the hardware's own instruction, while a
// vector mul_hi would be taken lane by lane.
INLINE void multiply_wide(uintv a, uint b, uintv *high, uintv *low) {
    const wide pairs = as_wide(a);
    const wide factor = (wide)((ulong)b);
    const wide low_word = (wide)(0xffffffffUL);
    const wide even = (pairs & low_word) * factor;
    const wide odd = (pairs >> 32) * factor;
    *high = as_uintv((even >> 32) | (odd & ~low_word));
    *low = as_uintv((even & low_word) | (odd << 32));
}
