// Mirror surface: the plane z = 0. Verbs: see surface_sphere.cl; all coefficients of the quadric form are 0. Unit: mm.
#include "simd_*.cl"

INLINE maskv surface_meet(__constant Mirror *mirror, realv x0, realv y0, realv p, realv q, vec3v *point) {
    *point = (vec3v){x0, y0, (realv)(0)};
    return x0 == x0;
}

// A vector along the surface normal, towards +Z; of unit length.
INLINE vec3v surface_normal(__constant Mirror *mirror, vec3v point) {
    return (vec3v){(realv)(0), (realv)(0), (realv)(1)};
}

INLINE realv surface_normal_square(vec3v normal) { return 1; }
