// Rays carry no polarisation: where no interface is tilted so much that it matters.
#include "simd_*.cl"

#define LIGHT_FIELDS(DO)
typedef struct { char none; } Stokes;
typedef struct { char none; } StokesOne;
