// The cover glass of a screen: a plane-parallel plate on the pixels. It moves a ray sideways, along its direction: light
// that leaves the plate at the angle i to the normal seems to come from t (tan i - tan i') beside the pixel, with
// sin i = n sin i'. Unit: mm.
#include "simd_*.cl"

// The light of a ray in the direction (l, m, -n) seems to start at (u, v): given the pixel's point, in a plane along
// which l and m are direction cosines.
INLINE void glass_leave(__constant Scene *scene, realv l, realv m, realv n, realv *u, realv *v) {
    const realv by = scene->glass_thickness * (1 / n - 1 / real_sqrt(scene->glass_index2 - 1 + n * n));
    *u -= by * l;
    *v -= by * m;
}

// How far a ray that arrives moves along its own slopes, over them. tan2: square of the slope to the normal.
INLINE realv glass_sideways(__constant Scene *scene, realv tan2) {
    return scene->glass_thickness * (1 / real_sqrt(scene->glass_index2 * (1 + tan2) - tan2) - 1);
}

// From where a ray with slopes du/dz, dv/dz meets the pixels' plane as if without glass, to where it lights them.
INLINE void glass_enter(__constant Scene *scene, realv slope_u, realv slope_v, realv *u, realv *v) {
    const realv by = glass_sideways(scene, slope_u * slope_u + slope_v * slope_v);
    *u += by * slope_u;
    *v += by * slope_v;
}

// The same on a bent screen: along_u, along_v: derivatives of the pixels' point by the grid's u and v, in the screen's
// frame. Curvature over the glass's thickness is left out.
INLINE void glass_enter_bent(__constant Scene *scene, vec3v along_u, vec3v along_v, realv slope_u, realv slope_v,
                             realv *u, realv *v) {
    const vec3v normal = {along_u.y * along_v.z - along_u.z * along_v.y, along_u.z * along_v.x - along_u.x * along_v.z,
                          along_u.x * along_v.y - along_u.y * along_v.x};
    const realv size2 = normal.x * normal.x + normal.y * normal.y + normal.z * normal.z;
    const realv depth = slope_u * normal.x + slope_v * normal.y + normal.z;
    const realv to = size2 / depth;      // the ray's step, of (slope_u, slope_v, 1), over which it sinks by |normal|
    const vec3v across = {to * slope_u - normal.x, to * slope_v - normal.y, to - normal.z};
    const realv across2 = across.x * across.x + across.y * across.y + across.z * across.z;
    const realv by = glass_sideways(scene, across2 / size2) / real_sqrt(size2);
    const realv uu = along_u.x * along_u.x + along_u.y * along_u.y + along_u.z * along_u.z;
    const realv uv = along_u.x * along_v.x + along_u.y * along_v.y + along_u.z * along_v.z;
    const realv vv = along_v.x * along_v.x + along_v.y * along_v.y + along_v.z * along_v.z;
    const realv on_u = across.x * along_u.x + across.y * along_u.y + across.z * along_u.z;
    const realv on_v = across.x * along_v.x + across.y * along_v.y + across.z * along_v.z;
    *u += by * (vv * on_u - uv * on_v) / size2;   // size2 is also uu vv - uv^2
    *v += by * (uu * on_v - uv * on_u) / size2;
}
