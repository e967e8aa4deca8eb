// The arithmetic type: IEEE single precision.
// real: a length, slope or direction cosine; mask: the integer type of a comparison of vectors of real.
#define REAL float
#define MASK int
#define real_sqrt_scalar(x) __builtin_sqrtf(x)
#define REAL_EPSILON 0x1p-23f
