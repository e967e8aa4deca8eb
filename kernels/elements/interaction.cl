// Shared by the interact_* files: the rays of a vector at one element. Frame: the element's. Unit: mm.
#include "element.cl"

// point, normal (unit, towards the front), along: where a ray meets the element, and its direction there; goes: its
// direction afterwards. arriving: its weight before; weight: factor on that weight; absorbed: share of it that stays
// here. split: share of it in a second, mirrored ray that splits off here; room: whether rays may split, 0 if too many
// wait. event: the EVENT_* that happens. ends: the ray stops here. draw: a random
// word. light: its polarisation; mirrored_light: that of the mirrored ray.
typedef struct {
    vec3v point, normal, along, goes;
    realv arriving, weight, absorbed, split;
    intv event, room;
    maskv ends;
    uintv draw;
    Stokes light, mirrored_light;
} Interaction;

INLINE vec3v blend3(maskv mask, vec3v yes, vec3v no) {
    return (vec3v){mask ? yes.x : no.x, mask ? yes.y : no.y, mask ? yes.z : no.z};
}

// Direction of a mirrored ray. All are unit vectors.
INLINE vec3v mirrored(vec3v along, vec3v normal) { return vector_along(along, -2 * dot3(along, normal), normal); }

INLINE vec3v to_world(__constant Element *element, vec3v a) {
    __constant real *x = element->axis_x, *y = element->axis_y, *z = element->axis_z;
    return (vec3v){x[0] * a.x + y[0] * a.y + z[0] * a.z, x[1] * a.x + y[1] * a.y + z[1] * a.z,
                   x[2] * a.x + y[2] * a.y + z[2] * a.z};
}

// A vector in space for one ray: lane k of a vec3v.
typedef struct { real x, y, z; } vec3s;

INLINE vec3s lane_of(vec3v a, int k) {
    return (vec3s){((const real *)&a.x)[k], ((const real *)&a.y)[k], ((const real *)&a.z)[k]};
}
