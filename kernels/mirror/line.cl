// A line of light, for the mirror and the devices' frames. Frame: the world. Unit: mm.
#include "simd_*.cl"

// The line (x0 + p z, y0 + q z, z). Light on it runs towards -z.
typedef struct { realv x0, y0, p, q; } Line;
