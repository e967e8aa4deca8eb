// The mirror as made, as an element: a quadric plus departures along z. Frame: the mirror's. Unit: mm.
#include "element.cl"
#include "departure.cl"

// Rays meet the quadric: the departure is far too small to change which element is nearest.
INLINE void meet_deviated(__constant Element *element, const Rays *rays, int v, int number, realv *nearest,
                          intv *which) {
    meet_quadric(element, rays, v, number, nearest, which);
}

INLINE vec3v deviated_point(__constant Scene *scene, __global const real *tables, __constant Element *element,
                            const LocalRay *ray, realv step) {
    vec3v point = quadric_point(scene, tables, element, ray, step);
    const vec3v normal = quadric_normal(scene, tables, element, point);
    realv height, slope_x, slope_y;
    mirror_departure(scene, tables, point.x, point.y, &height, &slope_x, &slope_y);
    const realv go = height * normal.z / dot3(ray->along, normal);   // along the ray, to the deviated surface
    return vector_along(point, go, ray->along);
}

INLINE vec3v deviated_normal(__constant Scene *scene, __global const real *tables, __constant Element *element,
                             vec3v point) {
    realv height, slope_x, slope_y;
    mirror_departure(scene, tables, point.x, point.y, &height, &slope_x, &slope_y);
    point.z -= height;
    const vec3v design = quadric_normal(scene, tables, element, point);
    const vec3v n = {design.x - slope_x * design.z, design.y - slope_y * design.z, design.z};
    const realv inverse = 1 / real_sqrt(dot3(n, n));
    return (vec3v){n.x * inverse, n.y * inverse, n.z * inverse};
}
