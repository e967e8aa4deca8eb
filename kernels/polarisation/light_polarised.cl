// Rays carry their linear polarisation: q and u are Stokes' second and third parameter over the first, told from the
// directions e and d x e, where d is the ray's; e (ex, ey, ez) is a unit vector at right angles to d, or zero for a ray
// that has been unpolarised so far. The fourth parameter is left out: only light that is totally reflected twice would
// need it. M. Born, E. Wolf, Principles of Optics, section 1.4.2.
#include "simd_*.cl"

#define LIGHT_FIELDS(DO) DO(real, q) DO(real, u) DO(real, ex) DO(real, ey) DO(real, ez)

// The light of the rays of a vector; e: in an element's frame. StokesOne: of one ray; e: in the world.
typedef struct { realv q, u; vec3v e; } Stokes;
typedef struct { real q, u, ex, ey, ez; } StokesOne;
