// Mirror aperture: a disk about the z axis. Frame: the mirror's. Unit: mm.
#include "circle.cl"

INLINE maskv aperture_contains(__constant Mirror *mirror, vec3v point) {
    return point.x * point.x + point.y * point.y <= mirror->aperture_radius2;
}

// Clips the interval [low, high] of a parameter to where a point that moves by (by_x, by_y) per unit stays inside. An
// interval that is all outside becomes empty.
INLINE void aperture_clip(__constant Mirror *mirror, vec3v point, real by_x, real by_y, realv *low, realv *high) {
    const realv room = mirror->aperture_radius2 - point.x * point.x - point.y * point.y;
    const realv growth = point.x * by_x + point.y * by_y;
    const Crossing rim = circle_crossing(growth, by_x * by_x + by_y * by_y, room);
    const realv enters = growth > 0 ? rim.far : rim.near, leaves = growth > 0 ? rim.near : rim.far;
    *high = ((growth != 0) & (leaves < *high)) ? leaves : *high;
    *low = ((growth != 0) & (enters > *low)) ? enters : *low;
    *high = ((growth == 0) & (room < 0)) ? *low : *high;
    *high = *high > *low ? *high : *low;
}
