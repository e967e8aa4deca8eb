// Rays that scatter at an element. A ray scatters with a given probability. Its direction is drawn from a lobe similar
// to the BSDF or towards a target: a disk, such as the camera's aperture, that the lobe would hardly ever hit. Its
// weight is the BSDF divided by the combined density of all these ways (the balance heuristic: E. Veach, L. J. Guibas,
// SIGGRAPH 95, 419), so no direction is missed and none counts twice. Scalar, because few rays scatter. Frame: the
// world. Unit: mm.
#include "split_ray.cl"
#include "uniform.cl"

enum { USE_SCATTER = 64, USE_WAY, USE_RADIUS, USE_ANGLE };   // path_word uses; lower ones are element numbers

INLINE real dots(vec3s a, vec3s b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
INLINE vec3s adds(vec3s a, real step, vec3s b) { return (vec3s){a.x + step * b.x, a.y + step * b.y, a.z + step * b.z}; }
INLINE vec3s reads(__constant real *a) { return (vec3s){a[0], a[1], a[2]}; }
INLINE real uniform_of(uint word) { return (real)((word >> 8) | 1u) * (real)0x1p-24; }

// A ray that scatters. at: its position, from its group's origin; normal: on the side it leaves to; beta0: projection
// of the specular direction onto the tangent plane; sine: length of beta0.
typedef struct { vec3s at, normal, beta0; real sine; int group; } Scattering;

// A direction and its projection beta onto the tangent plane.
typedef struct { vec3s along, beta; } Leaving;

// Density of beta in the lobe that directions are drawn from: proportional to (1 + d^2 / l^2)^(power - 1), d up to
// farthest.
INLINE real lobe_density(__constant Lobe *lobe, real d2, real farthest) {
    const real whole = pow(1 + farthest * farthest * lobe->inverse_l2, lobe->power) - 1;
    return pow(1 + d2 * lobe->inverse_l2, lobe->power - 1) * lobe->power * lobe->inverse_l2 / (whole * (real)M_PI_F);
}

// (a, b): uniform on the unit disk. The direction is zero if it would lie below the horizon.
INLINE Leaving from_lobe(__constant Lobe *lobe, const Scattering *ray, real a, real b) {
    const real u = a * a + b * b, farthest = 1 + lobe->centre * ray->sine;
    const real whole = pow(1 + farthest * farthest * lobe->inverse_l2, lobe->power) - 1;
    const real square = (pow(1 + u * whole, 1 / lobe->power) - 1) / lobe->inverse_l2;
    const real stretch = sqrt(max(square, (real)0) / u);
    const vec3s n = ray->normal, e = fabs(n.x) < (real)0.7 ? (vec3s){1, 0, 0} : (vec3s){0, 1, 0};
    vec3s s = adds(e, -dots(e, n), n);
    const real inverse = 1 / sqrt(dots(s, s));
    s = (vec3s){s.x * inverse, s.y * inverse, s.z * inverse};
    const vec3s t = {n.y * s.z - n.z * s.y, n.z * s.x - n.x * s.z, n.x * s.y - n.y * s.x};
    const vec3s zero = {0, 0, 0};
    Leaving leaving = {zero, adds(adds(adds(zero, lobe->centre, ray->beta0), stretch * a, s), stretch * b, t)};
    const real below = 1 - dots(leaving.beta, leaving.beta);
    if (below > 0) leaving.along = adds(leaving.beta, sqrt(below), n);
    return leaving;
}

INLINE Leaving to_target(__constant Target *target, const Scattering *ray, real a, real b) {
    const vec3s centre = reads(target->centre[ray->group]);
    vec3s to = adds(adds(adds(centre, -1, ray->at), target->radius * a, reads(target->axis_x)), target->radius * b,
                    reads(target->axis_y));
    const real inverse = 1 / sqrt(dots(to, to));
    to = (vec3s){to.x * inverse, to.y * inverse, to.z * inverse};
    return (Leaving){to, adds(to, -dots(to, ray->normal), ray->normal)};
}

// Density per solid angle of to_target's directions; sure: this direction is known to be one of them.
INLINE real target_density(__constant Target *target, const Scattering *ray, vec3s along, bool sure) {
    const vec3s to = adds(reads(target->centre[ray->group]), -1, ray->at), z = reads(target->axis_z);
    const real slope = dots(along, z), step = dots(to, z) / slope;
    const vec3s off = adds(to, -step, along);
    if (!(step > 0) || !(sure || dots(off, off) < target->radius * target->radius)) return 0;
    return step * step / ((real)M_PI_F * target->radius * target->radius * fabs(slope));
}

// Draws a direction and sets its density per solid angle, 0 if there is no direction. way: uniform, chooses lobe or
// target.
INLINE Leaving draw_direction(__constant Scatter *scatter, __constant Lobe *lobe, const Scattering *ray, real way,
                              real a, real b, real *density) {
    const int count = lobe->target_count;
    const real share = (1 - lobe->share) / max(count, 1);   // of each target
    const int chosen = way < lobe->share ? -1 : min((int)((way - lobe->share) / share), count - 1);
    const Leaving leaving = chosen < 0 ? from_lobe(lobe, ray, a, b)
                                       : to_target(&scatter->targets[lobe->target[chosen]], ray, a, b);
    const real cosine = dots(leaving.along, ray->normal);
    *density = 0;
    if (!(cosine > 0)) return leaving;
    const vec3s zero = {0, 0, 0}, off = adds(leaving.beta, -lobe->centre, ray->beta0);
    *density = lobe->share * lobe_density(lobe, dots(off, off), 1 + lobe->centre * ray->sine) * cosine;
    for (int k = 0; k < count; ++k)
        *density += share * target_density(&scatter->targets[lobe->target[k]], ray, leaving.along, k == chosen);
    return leaving;
}

// Share of the light that scatters at this cosine of the specular direction: interpolated in the table by its root.
INLINE realv scattered_share(__constant Lobe *lobe, realv cosine) {
    const int nodes = sizeof(lobe->tis) / sizeof(lobe->tis[0]);
    const realv root = real_sqrt(magnitude(cosine)) * (real)(nodes - 1);
    realv share;
    for (int k = 0; k < WIDTH; ++k) {
        const real x = ((const real *)&root)[k];
        const int node = clamp((int)x, 0, nodes - 2);
        ((real *)&share)[k] = lobe->tis[node] + (x - node) * (lobe->tis[node + 1] - lobe->tis[node]);
    }
    return share;
}

// Ray k of vector v, which has just left along the specular direction.
INLINE Scattering scattering_of(const Rays *rays, int v, int k, vec3s normal) {
    const vec3s specular = lane_of((vec3v){rays->dx[v], rays->dy[v], rays->dz[v]}, k);
    Scattering ray;
    ray.at = lane_of((vec3v){rays->x[v], rays->y[v], rays->z[v]}, k);
    const real side = dots(specular, normal) < 0 ? -1 : 1;
    ray.normal = (vec3s){side * normal.x, side * normal.y, side * normal.z};
    ray.beta0 = adds(specular, -dots(specular, ray.normal), ray.normal);
    ray.sine = sqrt(dots(ray.beta0, ray.beta0));
    ray.group = ((const int *)&rays->group[v])[k];
    return ray;
}

// Share of an interaction's light that stays specular.
INLINE realv specular_share(const Trace *trace, int number, const Interaction *at) {
    return 1 - scattered_share(&trace->scatter->lobes[number], dot3(at->goes, at->normal));
}

// The rays of a vector that scatter, and the random numbers and world normals that their directions are drawn with.
typedef struct { ulong lanes; uintv way; realv a, b; vec3v normals; } Scatterers;

// way, a, b and normals are set only if some lane scatters.
INLINE Scatterers scatterers_of(const Trace *trace, const Rays *rays, int v, int number, maskv meets,
                                const Interaction *at) {
    const PathCode path = path_of(rays, v);
    const uintv key = rays->key[v];
    const maskv chosen = meets & (rays->weight[v] > 0) &
                         (uniform_open(path_word(key, &path, USE_SCATTER)) < trace->scatter->lobes[number].probability);
    Scatterers some;
    some.lanes = mask_word(chosen);
    if (some.lanes == 0) return some;
    some.normals = to_world(&trace->elements[number], at->normal);
    some.way = path_word(key, &path, USE_WAY);
    unit_disk(path_word(key, &path, USE_RADIUS), path_word(key, &path, USE_ANGLE), &some.a, &some.b);
    return some;
}

// A scattered ray: direction, its density per solid angle (0: no direction), its cosine to the normal, and d^2 for the
// BSDF.
typedef struct { vec3s along; real density, cosine, d2; } Scattered;

INLINE Scattered scatter_lane(const Trace *trace, const Rays *rays, int v, int k, __constant Lobe *lobe,
                              const Scatterers *some) {
    const Scattering ray = scattering_of(rays, v, k, lane_of(some->normals, k));
    Scattered scattered;
    const Leaving leaving = draw_direction(trace->scatter, lobe, &ray, uniform_of(((const uint *)&some->way)[k]),
                                           ((const real *)&some->a)[k], ((const real *)&some->b)[k],
                                           &scattered.density);
    const vec3s off = adds(leaving.beta, -1, ray.beta0);
    scattered.along = leaving.along;
    scattered.cosine = dots(leaving.along, ray.normal);
    scattered.d2 = dots(off, off);
    return scattered;
}

INLINE void scatter_split(const Trace *trace, const Rays *rays, int v, int k, __constant Lobe *lobe,
                          const Interaction *at, const Scattered *scattered, real bsdf) {
    const real weight = bsdf * scattered->cosine / scattered->density;
    split_ray(trace, rays, v, k, scattered->along, ((const real *)&rays->weight[v])[k] * weight / lobe->probability,
              ((const int *)&at->event)[k], EVENT_SCATTER, light_natural());
}

// The two functions of a scatter model, made from its bsdf_*(lobe, d^2). *_left: the share of an interaction's light
// that stays specular. *_split: splits the scattered rays from those that have just left the element, whose weight
// still includes the scattered light.
#define SCATTERS(model)                                                                                            \
    INLINE realv model##_left(const Trace *trace, int number, const Interaction *at) {                             \
        return specular_share(trace, number, at);                                                                  \
    }                                                                                                              \
    INLINE void model##_split(const Trace *trace, const Rays *rays, int v, int number, maskv meets,                \
                              const Interaction *at) {                                                             \
        __constant Lobe *lobe = &trace->scatter->lobes[number];                                                    \
        const Scatterers some = scatterers_of(trace, rays, v, number, meets, at);                                  \
        for (ulong lanes = some.lanes; lanes != 0; lanes &= lanes - 1) {                                           \
            const int k = lowest_lane(lanes);                                                                      \
            const Scattered scattered = scatter_lane(trace, rays, v, k, lobe, &some);                              \
            if (scattered.density > 0)                                                                             \
                scatter_split(trace, rays, v, k, lobe, at, &scattered, bsdf_##model(lobe, scattered.d2));          \
        }                                                                                                          \
    }
