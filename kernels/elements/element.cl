// Elements of a non-sequential trace: where a ray meets one. Frame: the element's own, +z its front. Unit: mm.
//
// A ray never meets the plane that it stands on. Of a quadric that it stands on, it meets only the other root. So rays
// need no offset. For other elements a root counts if the step exceeds -bound, where bound is the rounding error of the
// step; so a ray does not miss a surface that touches its own. A ray that has just gone from one element to another
// that touches it ignores the earlier one up to the same bound.
#include "ray.cl"

#define ROUNDING (8 * REAL_EPSILON)

// The rays of a vector in an element's frame.
typedef struct { vec3v at, along; } LocalRay;

INLINE realv dot3(vec3v a, vec3v b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE vec3v vector_along(vec3v at, realv step, vec3v along) {
    return (vec3v){at.x + step * along.x, at.y + step * along.y, at.z + step * along.z};
}

// What is added to positions relative to the rays' groups to get positions in the element's frame. size: the sum of its
// magnitudes.
typedef struct { vec3v to; realv size; } Offset;

INLINE Offset group_offset(__constant Element *element, intv group) {
    const int first = ((const int *)&group)[0], groups = sizeof(element->offset) / sizeof(element->offset[0]);
    __constant real *of_first = element->offset[first];
    Offset offset = {{of_first[0], of_first[1], of_first[2]}, of_first[3]};
    if (!any_lane(to_mask(group != first))) return offset;   // nearly always
    for (int g = 0; g < groups; ++g) {
        const maskv of_group = to_mask(group == g);
        offset.to.x = of_group ? (realv)(element->offset[g][0]) : offset.to.x;
        offset.to.y = of_group ? (realv)(element->offset[g][1]) : offset.to.y;
        offset.to.z = of_group ? (realv)(element->offset[g][2]) : offset.to.z;
        offset.size = of_group ? (realv)(element->offset[g][3]) : offset.size;
    }
    return offset;
}

// One coordinate, along an axis of an element, of the positions or directions of the rays of vector v.
INLINE realv position_along(__constant real *axis, const Rays *rays, int v) {
    return axis[0] * rays->x[v] + axis[1] * rays->y[v] + axis[2] * rays->z[v];
}
INLINE realv direction_along(__constant real *axis, const Rays *rays, int v) {
    return axis[0] * rays->dx[v] + axis[1] * rays->dy[v] + axis[2] * rays->dz[v];
}

INLINE LocalRay element_ray(__constant Element *element, const Rays *rays, int v, const Offset *offset) {
    LocalRay ray;
    ray.at = (vec3v){position_along(element->axis_x, rays, v) + offset->to.x,
                     position_along(element->axis_y, rays, v) + offset->to.y,
                     position_along(element->axis_z, rays, v) + offset->to.z};
    ray.along = (vec3v){direction_along(element->axis_x, rays, v), direction_along(element->axis_y, rays, v),
                        direction_along(element->axis_z, rays, v)};
    return ray;
}

INLINE maskv element_contains(__constant Element *element, realv u, realv v) {
    const realv radius2 = u * u + v * v;
    return (radius2 <= element->outer2) & (radius2 >= element->inner2) & (u <= element->half_u) &
           (-u <= element->half_u) & (v <= element->half_v) & (-v <= element->half_v);
}

// Rounding error of a step. A crossing at a smaller step cannot be distinguished from the ray's own position.
INLINE realv element_bound(const Rays *rays, int v, const Offset *offset) {
    return (real)ROUNDING * (rays->l1_norm[v] + offset->size);
}

// Takes the step to an element if it is the nearest so far, in front of the ray, and not excluded.
INLINE void element_offer(const Rays *rays, int v, int number, realv step, realv bound, maskv meets, realv *nearest,
                          intv *element) {
    const maskv passed = to_mask(rays->before[v] == number) & (step <= bound);
    const maskv take = meets & (step > -bound) & !passed & (step < *nearest);
    *nearest = take ? step : *nearest;
    *element = to_int(take) != 0 ? (intv)(number) : *element;
}

INLINE void meet_plane(__constant Element *element, const Rays *rays, int v, int number, realv *nearest, intv *which) {
    const Offset offset = group_offset(element, rays->group[v]);
    // infinite or NaN if parallel: every comparison below rejects it
    const realv step = -(position_along(element->axis_z, rays, v) + offset.to.z)
                       / direction_along(element->axis_z, rays, v);
    const realv bound = element_bound(rays, v, &offset);
    const maskv ahead = (step > -bound) & (step < *nearest) & to_mask(rays->last[v] != number);
    if (!any_lane(ahead)) return;
    const LocalRay ray = element_ray(element, rays, v, &offset);
    const maskv meets = element_contains(element, ray.at.x + step * ray.along.x, ray.at.y + step * ray.along.y);
    element_offer(rays, v, number, step, bound, meets & ahead, nearest, which);
}

// Bilinear form of the quadric q_xx x^2 + q_yy y^2 + q_zz z^2 + 2 q_xz x z - 2 z = 0.
INLINE realv quadric_form(__constant Element *element, vec3v a, vec3v b) {
    return element->q_xx * a.x * b.x + element->q_yy * a.y * b.y + element->q_zz * a.z * b.z +
           element->q_xz * (a.x * b.z + a.z * b.x);
}

// Whether a point of the quadric belongs to the element: its normal points to the front and it lies in the aperture.
INLINE maskv quadric_holds(__constant Element *element, vec3v point) {
    return (element->q_zz * point.z + element->q_xz * point.x < 1) & element_contains(element, point.x, point.y);
}

INLINE void meet_quadric(__constant Element *element, const Rays *rays, int v, int number, realv *nearest,
                         intv *which) {
    const Offset offset = group_offset(element, rays->group[v]);
    const LocalRay ray = element_ray(element, rays, v, &offset);
    const maskv stands = to_mask(rays->last[v] == number);
    // Start at the ray's point nearest the vertex: all numbers then have the element's size, however far the source is.
    const realv back = stands ? (realv)(0) : -dot3(ray.at, ray.along);
    const vec3v base = vector_along(ray.at, back, ray.along);
    const realv a = quadric_form(element, ray.along, ray.along);
    const realv b = quadric_form(element, base, ray.along) - ray.along.z;
    const realv c = stands ? (realv)(0) : quadric_form(element, base, base) - 2 * base.z;
    const realv root = real_sqrt(b * b - a * c);
    const realv sum = b < 0 ? root - b : -root - b;
    const realv bound = element_bound(rays, v, &offset);
    const realv first = c / sum, second = sum / a;   // no root: NaN; a = 0: infinite
    element_offer(rays, v, number, back + first, bound,
                  !stands & quadric_holds(element, vector_along(base, first, ray.along)), nearest, which);
    element_offer(rays, v, number, back + second, stands ? -bound : bound,
                  quadric_holds(element, vector_along(base, second, ray.along)), nearest, which);
}

// The point where a ray met the element, and the unit normal there, towards the front.
INLINE vec3v plane_point(__constant Scene *scene, __global const real *tables, __constant Element *element,
                         const LocalRay *ray, realv step) {
    vec3v point = vector_along(ray->at, step, ray->along);
    point.z = 0;
    return point;
}
INLINE vec3v plane_normal(__constant Scene *scene, __global const real *tables, __constant Element *element,
                          vec3v point) {
    return (vec3v){0, 0, 1};
}

// The point is moved onto the surface along z, because the step's rounding error grows with its length.
INLINE vec3v quadric_point(__constant Scene *scene, __global const real *tables, __constant Element *element,
                           const LocalRay *ray, realv step) {
    vec3v point = vector_along(ray->at, step, ray->along);
    const realv b = 1 - element->q_xz * point.x;
    const realv c = element->q_xx * point.x * point.x + element->q_yy * point.y * point.y;
    point.z = c / (b + real_sqrt(b * b - element->q_zz * c));
    return point;
}
INLINE vec3v quadric_normal(__constant Scene *scene, __global const real *tables, __constant Element *element,
                            vec3v point) {
    const vec3v n = {-(element->q_xx * point.x + element->q_xz * point.z), -element->q_yy * point.y,
                     1 - element->q_zz * point.z - element->q_xz * point.x};
    const realv inverse = 1 / real_sqrt(dot3(n, n));
    return (vec3v){n.x * inverse, n.y * inverse, n.z * inverse};
}
