// What becomes of the polarisation of rays where nothing refracts. Frame: the world, in an Interaction the element's.
#include "interaction.cl"

// Light of the screen is unpolarised.
INLINE void light_emit(Rays *rays, int v) {
    rays->q[v] = rays->u[v] = rays->ex[v] = rays->ey[v] = rays->ez[v] = (realv)(0);
}

INLINE Stokes light_arrive(__constant Element *element, const Rays *rays, int v) {
    __constant real *x = element->axis_x, *y = element->axis_y, *z = element->axis_z;
    const realv ex = rays->ex[v], ey = rays->ey[v], ez = rays->ez[v];
    const vec3v e = {x[0] * ex + x[1] * ey + x[2] * ez, y[0] * ex + y[1] * ey + y[2] * ez,
                     z[0] * ex + z[1] * ey + z[2] * ez};
    return (Stokes){rays->q[v], rays->u[v], e};
}

INLINE void light_leave(__constant Element *element, Rays *rays, int v, maskv meets, const Interaction *at) {
    const vec3v e = to_world(element, at->light.e);
    rays->q[v] = meets ? at->light.q : rays->q[v];
    rays->u[v] = meets ? at->light.u : rays->u[v];
    rays->ex[v] = meets ? e.x : rays->ex[v];
    rays->ey[v] = meets ? e.y : rays->ey[v];
    rays->ez[v] = meets ? e.z : rays->ez[v];
}

// A mirror reflects both polarisations alike: the reference turns with the ray, which changes the sign of u.
INLINE void light_mirror(Interaction *at) {
    at->light.e = mirrored(at->light.e, at->normal);
    at->light.u = -at->light.u;
}

// A paraxial lens turns the reference with the ray, by the smallest rotation.
INLINE void light_turn(Interaction *at) {
    const vec3v before = at->along, after = at->goes, e = at->light.e;
    const realv turn = -dot3(e, after) / (1 + dot3(before, after));
    at->light.e = vector_along(vector_along(e, turn, before), turn, after);
}

// Scattered light is taken as unpolarised.
INLINE StokesOne light_natural(void) { return (StokesOne){0, 0, 0, 0, 0}; }

// Of the mirrored ray that splits from ray k at an interface.
INLINE StokesOne light_reflected(__constant Element *element, const Interaction *at, int k) {
    const vec3s e = lane_of(to_world(element, at->mirrored_light.e), k);
    return (StokesOne){((const real *)&at->mirrored_light.q)[k], ((const real *)&at->mirrored_light.u)[k], e.x, e.y,
                       e.z};
}

INLINE void light_put(Rays *rays, int place, StokesOne light) {
    ((real *)rays->q)[place] = light.q;
    ((real *)rays->u)[place] = light.u;
    ((real *)rays->ex)[place] = light.ex;
    ((real *)rays->ey)[place] = light.ey;
    ((real *)rays->ez)[place] = light.ez;
}
