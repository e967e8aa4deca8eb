// The arithmetic type: IEEE double precision, for reference runs and for scenes that single precision cannot hold.
// real: a length, slope or direction cosine; mask: the integer type of a comparison of vectors of real.
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define REAL double
#define MASK long
#define real_sqrt_scalar(x) __builtin_sqrt(x)
#define REAL_EPSILON 0x1p-52
