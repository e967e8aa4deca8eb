// Mirror surface: a segment of a conic of revolution away from its axis, in the segment's own frame (origin on the
// surface, +Z along the normal there, +X away from the parent's axis). Verbs and quadric form: see surface_sphere.cl;
// the rotated quadric keeps only the cross term q_xz. Unit: mm.
#include "quadric.cl"

INLINE maskv surface_meet(__constant Mirror *mirror, realv x0, realv y0, realv p, realv q, vec3v *point) {
    const realv a = mirror->q_xx * p * p + mirror->q_yy * q * q + mirror->q_zz + 2 * mirror->q_xz * p;
    const realv b = 1 - (mirror->q_xx * x0 * p + mirror->q_yy * y0 * q + mirror->q_xz * x0);
    const realv c = mirror->q_xx * x0 * x0 + mirror->q_yy * y0 * y0;
    quadric_root(a, b, c, x0, y0, p, q, point);
    return mirror->q_zz * point->z + mirror->q_xz * point->x < 1;
}

// A vector along the surface normal, towards +Z; not of unit length.
INLINE vec3v surface_normal(__constant Mirror *mirror, vec3v point) {
    return (vec3v){-(mirror->q_xx * point.x + mirror->q_xz * point.z), -mirror->q_yy * point.y,
                   1 - mirror->q_zz * point.z - mirror->q_xz * point.x};
}

INLINE realv surface_normal_square(vec3v normal) {
    return normal.x * normal.x + normal.y * normal.y + normal.z * normal.z;
}
