// A paraxial lens in the element's plane z = 0: at (a, b) it turns slopes (p, q) into (p - a / f, q - b / f), for light
// from either side. Slopes are per length along the direction of travel. Frame: the element's. Unit: mm.
#include "carry_*.cl"

INLINE void interact_lens(__constant Element *element, Interaction *at) {
    const realv forward = at->along.z < 0 ? (realv)(-1) : (realv)(1);
    const realv inverse = forward / at->along.z;   // 1 / |z|
    const realv p = at->along.x * inverse - at->point.x * element->inverse_focal_length;
    const realv q = at->along.y * inverse - at->point.y * element->inverse_focal_length;
    const realv scale = 1 / real_sqrt(1 + p * p + q * q);
    at->goes = (vec3v){p * scale, q * scale, forward * scale};
    at->weight = element->transmittance;
    at->absorbed = 1 - at->weight;
    light_turn(at);
}
