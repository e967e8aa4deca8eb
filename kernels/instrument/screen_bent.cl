// A bent screen. The verbs are those of screen_flat.cl. Frames: the screen's and the world's. Unit: mm.
//
// An emitter has its own plane, tangent to the screen at its centre (irtscots_cl/optics/screen_facets.py). A receiver
// has the part of the screen that it sees: the pixel at (u + du, v + dv) of the grid is at (u + du + x, v + dv + y, z),
// where x, y, z are cubics in du, dv (irtscots_cl/tracing/packing/screen_patches.py).
#include "device_frame.cl"
#include "glass_*.cl"

INLINE Line screen_emit(__constant Scene *scene, const Emitter *emitter, realv s, realv t, realv l, realv m, realv n) {
    const Facet *facet = &emitter->facet;
    realv moved_x = (realv)(0), moved_y = (realv)(0);
    glass_leave(scene, l, m, n, &moved_x, &moved_y);
    realv point[3], along[3];
    for (int k = 0; k < 3; ++k) {
        along[k] = facet->axis_x[k] * l + facet->axis_y[k] * m - facet->axis_z[k] * n;
        point[k] = facet->point[k] + (facet->pixel_x[k] * s + facet->pixel_y[k] * t
                                      + facet->axis_x[k] * moved_x + facet->axis_y[k] * moved_y);
    }
    const realv inverse = 1 / along[2], p = along[0] * inverse, q = along[1] * inverse;
    return (Line){point[0] - point[2] * p, point[1] - point[2] * q, p, q};
}

// The terms of second and third order of a cubic, and a cubic's derivatives by u and v.
INLINE realv cubic_bend(const real *c, realv u, realv v) {
    return u * (u * (c[3] + c[6] * u + c[7] * v) + v * (c[4] + c[8] * v)) + v * v * (c[5] + c[9] * v);
}
INLINE realv cubic_by_u(const real *c, realv u, realv v) {
    return c[1] + u * (2 * c[3] + 3 * c[6] * u + 2 * c[7] * v) + v * (c[4] + c[8] * v);
}
INLINE realv cubic_by_v(const real *c, realv u, realv v) {
    return c[2] + u * (c[4] + c[7] * u + 2 * c[8] * v) + v * (2 * c[5] + 3 * c[9] * v);
}

// First the plane that is tangent at the middle of the part, exactly; then steps that bring in the bend, each of which
// leaves a small share of the last error. The host chooses their number.
INLINE maskv screen_meet(__constant Scene *scene, const Receiver *receiver, maskv ahead, realv slope_u, realv slope_v,
                         realv *u, realv *v) {
    const Patch *patch = &receiver->patch;
    const real *x = patch->x, *y = patch->y, *z = patch->z;
    const realv goal_u = *u - patch->u - x[0] + slope_u * z[0], goal_v = *v - patch->v - y[0] + slope_v * z[0];
    const realv xx = 1 + x[1] - slope_u * z[1], xy = x[2] - slope_u * z[2];
    const realv yx = y[1] - slope_v * z[1], yy = 1 + y[2] - slope_v * z[2];
    const realv determinant = xx * yy - xy * yx, inverse = 1 / determinant;
    realv du = (yy * goal_u - xy * goal_v) * inverse, dv = (xx * goal_v - yx * goal_u) * inverse;
    for (int step = 0; step < patch->steps; ++step) {
        const realv bend = cubic_bend(z, du, dv);
        const realv left_u = goal_u - cubic_bend(x, du, dv) + slope_u * bend;
        const realv left_v = goal_v - cubic_bend(y, du, dv) + slope_v * bend;
        du = (yy * left_u - xy * left_v) * inverse;
        dv = (xx * left_v - yx * left_u) * inverse;
    }
    const vec3v along_u = {1 + cubic_by_u(x, du, dv), cubic_by_u(y, du, dv), cubic_by_u(z, du, dv)};
    const vec3v along_v = {cubic_by_v(x, du, dv), 1 + cubic_by_v(y, du, dv), cubic_by_v(z, du, dv)};
    glass_enter_bent(scene, along_u, along_v, slope_u, slope_v, &du, &dv);
    *u = patch->u + du;
    *v = patch->v + dv;
    return ahead & (determinant > 0);   // else it meets the back
}
