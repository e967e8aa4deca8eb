// Where a line meets a quadric, for the surface_* files. Frame: the mirror's. Unit: mm.
#include "simd_*.cl"

// The point (x0 + p z, y0 + q z, z) of a line with a z^2 - 2 b z + c = 0: the root nearest the origin, in a form that
// neither cancels nor divides by a small a. NaN if there is no root. The point may lie on the other half of the parent
// surface; the caller must reject it.
INLINE void quadric_root(realv a, realv b, realv c, realv x0, realv y0, realv p, realv q, vec3v *point) {
    const realv discriminant = b * b - a * c;
    point->z = c / (b + real_sqrt(discriminant));
    point->x = x0 + p * point->z;
    point->y = y0 + q * point->z;
}
