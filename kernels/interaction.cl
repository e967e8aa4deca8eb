// What the interact_* files share: rays of a vector at one element, on their way through it. Frame: the element's. mm.
#include "element.cl"

// point, normal (unit, towards the front), along: of a ray where it meets the element; goes: its direction afterwards,
// weight: what its weight is multiplied by. event: what happens. ends: it goes no further. draw: a random word.
typedef struct {
    vec3v point, normal, along, goes;
    realv weight;
    intv event;
    maskv ends;
    uintv draw;
} Interaction;

INLINE vec3v blend3(maskv mask, vec3v yes, vec3v no) {
    return (vec3v){mask ? yes.x : no.x, mask ? yes.y : no.y, mask ? yes.z : no.z};
}

// Direction of a mirrored ray; all unit vectors.
INLINE vec3v mirrored(vec3v along, vec3v normal) { return vector_along(along, -2 * dot3(along, normal), normal); }
