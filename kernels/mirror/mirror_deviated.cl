// The mirror as made: a quadric plus departures along z, kept apart so that neither loses digits. The same verbs as
// mirror_nominal.cl. Frame: the world. Unit: mm.
#include "surface_*.cl"
#include "aperture_*.cl"
#include "outline_*.cl"
#include "departure.cl"

// Where a line meets the mirror, and the departure and its slopes there. on_mirror: false if it misses the aperture or
// the surface.
typedef struct { vec3v point; maskv on_mirror; realv height, slope_x, slope_y; } Meeting;

#include "approach_*.cl"

INLINE Meeting mirror_meet(__constant Scene *scene, __global const real *tables, const Line *line) {
    Meeting at;
    at.on_mirror = surface_meet(&scene->mirror, line->x0, line->y0, line->p, line->q, &at.point);
    return at;
}

// Follows the line from the quadric to the surface.
INLINE void mirror_deviate(__constant Scene *scene, __global const real *tables, const Line *line, Meeting *at) {
    const vec3v base = at->point;
    // Polynomials grow fast outside their disk. A line that meets the quadric that far out is not on the mirror.
    at->on_mirror &= base.x * base.x + base.y * base.y <= scene->mirror.departure_radius2;
    mirror_approach(scene, tables, line, base, surface_normal(&scene->mirror, base), at);
    at->on_mirror &= aperture_contains(&scene->mirror, at->point);
    outline_limit(scene, tables, at->point, &at->on_mirror);
}

// The quadric's normal below the point.
INLINE vec3v mirror_design_normal(__constant Scene *scene, const Meeting *at) {
    return surface_normal(&scene->mirror, (vec3v){at->point.x, at->point.y, at->point.z - at->height});
}

// The quadric's normal tilted by the departure's slopes. The sum loses slight slopes; see arrival_compensated.cl.
INLINE vec3v mirror_normal(__constant Scene *scene, const Meeting *at) {
    vec3v normal = mirror_design_normal(scene, at);
    normal.x -= at->slope_x * normal.z;
    normal.y -= at->slope_y * normal.z;
    return normal;
}

INLINE realv mirror_normal_square(vec3v normal) {
    return normal.x * normal.x + normal.y * normal.y + normal.z * normal.z;
}
