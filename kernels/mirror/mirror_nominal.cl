// The mirror as designed: where a line meets it, and the normal there. Frame: the world. Unit: mm.
#include "surface_*.cl"
#include "aperture_*.cl"
#include "outline_*.cl"

// Where a line meets the mirror. on_mirror: false if it misses the surface or its aperture.
typedef struct { vec3v point; maskv on_mirror; } Meeting;

INLINE Meeting mirror_meet(__constant Scene *scene, __global const real *tables, const Line *line) {
    Meeting at;
    at.on_mirror = surface_meet(&scene->mirror, line->x0, line->y0, line->p, line->q, &at.point);
    at.on_mirror &= aperture_contains(&scene->mirror, at.point);
    outline_limit(scene, tables, at.point, &at.on_mirror);
    return at;
}

INLINE void mirror_deviate(__constant Scene *scene, __global const real *tables, const Line *line, Meeting *at) {}

INLINE vec3v mirror_normal(__constant Scene *scene, const Meeting *at) {
    return surface_normal(&scene->mirror, at->point);
}

// The square of that vector's length.
INLINE realv mirror_normal_square(vec3v normal) { return surface_normal_square(normal); }
