// Mirror surface: conic of revolution about +Z, vertex at the origin. Verbs and quadric form: see surface_sphere.cl,
// with q_xx = q_yy = 1 / radius, q_zz = (1 + conic) / radius, q_xz = 0. Unit: mm.
#include "quadric.cl"

INLINE maskv surface_meet(__constant Mirror *mirror, realv x0, realv y0, realv p, realv q, vec3v *point) {
    const real curvature = mirror->q_xx;
    const realv a = curvature * (p * p + q * q) + mirror->q_zz;
    const realv b = 1 - curvature * (x0 * p + y0 * q);
    const realv c = curvature * (x0 * x0 + y0 * y0);
    quadric_root(a, b, c, x0, y0, p, q, point);
    return mirror->q_zz * point->z < 1;
}

// A vector along the surface normal, towards +Z; not of unit length.
INLINE vec3v surface_normal(__constant Mirror *mirror, vec3v point) {
    const real curvature = mirror->q_xx;
    return (vec3v){-curvature * point.x, -curvature * point.y, 1 - mirror->q_zz * point.z};
}

INLINE realv surface_normal_square(vec3v normal) {
    return normal.x * normal.x + normal.y * normal.y + normal.z * normal.z;
}
