// The mirror as designed: where a line meets it and the normal there.
#include "surface_*.cl"
#include "aperture_*.cl"

// The line is (x0 + p z, y0 + q z, z), in the mirror's frame, mm. Returns true where it meets the mirror's aperture.
INLINE maskv mirror_meet(__constant Scene *scene, realv x0, realv y0, realv p, realv q, vec3v *point, vec3v *normal) {
    __constant Mirror *mirror = &scene->mirror;
    const maskv met = surface_meet(mirror, x0, y0, p, q, point);
    *normal = surface_normal(mirror, *point);
    return met & aperture_contains(mirror, *point);
}
