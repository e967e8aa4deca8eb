// Mirror surface: sphere. Frame: the mirror's (origin at the vertex, +Z along the normal). Unit: mm.
// In the quadric form shared by the surface_* files, q_xx x^2 + q_yy y^2 + q_zz z^2 + 2 q_xz x z - 2 z = 0, a sphere
// has q_xx = q_yy = q_zz = 1 / radius and q_xz = 0. The radius is below 0 for a convex mirror.
#include "quadric.cl"

// Where the line (x0 + p z, y0 + q z, z) meets the surface: the root nearest the vertex. All numbers have the size of
// the mirror, whatever the distance to the line's source, so single precision suffices. Returns false if the line
// misses the surface: there is no root, or the normal there points down, as it does above the parent's widest circle
// and on the second sheet of a hyperboloid.
INLINE maskv surface_meet(__constant Mirror *mirror, realv x0, realv y0, realv p, realv q, vec3v *point) {
    const real curvature = mirror->q_xx;
    const realv a = curvature * (p * p + q * q + 1);
    const realv b = 1 - curvature * (x0 * p + y0 * q);
    const realv c = curvature * (x0 * x0 + y0 * y0);
    quadric_root(a, b, c, x0, y0, p, q, point);
    return curvature * point->z < 1;
}

// A vector along the surface normal, towards +Z; its length is 1 to rounding.
INLINE vec3v surface_normal(__constant Mirror *mirror, vec3v point) {
    const real curvature = mirror->q_xx;
    return (vec3v){-curvature * point.x, -curvature * point.y, 1 - curvature * point.z};
}

// The square of that vector's length.
INLINE realv surface_normal_square(vec3v normal) { return 1; }
