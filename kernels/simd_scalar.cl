// Types for GPUs: one ray per work-item. The same verbs as simd_vector.cl.
#include "real_*.cl"

// A helper that is not inlined hands vectors over through memory: half the speed.
#define INLINE inline __attribute__((always_inline))

typedef REAL real;
typedef REAL realv;
typedef int maskv;                        // 0 or 1, as the comparison operators give it
typedef int intv;
typedef uint uintv;

#define WIDTH 1
#define BLOCK_VECTORS 1                   // nothing to compact: a work-item bins its ray at once

#define to_real(v) ((real)(v))
#define to_int(v) ((int)(v))
#define to_uint(v) ((uint)(v))
#define to_mask(v) ((int)(v))

#define as_intv(v) as_int(v)
#define as_uintv(v) as_uint(v)

typedef struct { realv x, y, z; } vec3v;

INLINE uintv lane_index(void) { return 0; }

INLINE realv real_sqrt(realv x) { return sqrt(x); }

// masks: the negated sum of masks, as in simd_vector.cl.
INLINE uint count_lanes(intv masks) { return (uint)(-masks); }

INLINE void multiply_wide(uintv a, uint b, uintv *high, uintv *low) {
    *high = mul_hi(a, b);
    *low = a * b;
}
