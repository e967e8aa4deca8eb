// A line and a quadric, for the surface_* files.
#include "simd_*.cl"

// The point (x0 + p z, y0 + q z, z) of a line with a z^2 - 2 b z + c = 0: the root next to the origin, in a form that
// neither cancels nor divides by a small a. NaN where there is none. It may lie on the parent's other half, which is for
// the caller to refuse.
INLINE void quadric_root(realv a, realv b, realv c, realv x0, realv y0, realv p, realv q, vec3v *point) {
    const realv discriminant = b * b - a * c;
    point->z = c / (b + real_sqrt(discriminant));
    point->x = x0 + p * point->z;
    point->y = y0 + q * point->z;
}
