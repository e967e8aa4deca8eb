// A mirror whose outline is a convex polygon within its aperture: half planes. Frame: the mirror's. Unit: mm.
#include "simd_*.cl"

// Clears `inside` where the point lies beyond a side. tables: not used.
INLINE void outline_limit(__constant Scene *scene, __global const real *tables, vec3v point, maskv *inside) {
    __constant OutlinePlane *plane = scene->outline.planes;
    for (int k = 0; k < (int)(sizeof(scene->outline.planes) / sizeof(OutlinePlane)); ++k)
        *inside &= plane[k].normal_x * point.x + plane[k].normal_y * point.y <= plane[k].distance;
}

// Clips the interval [low, high] of a parameter to where a point that moves by (by_x, by_y) per unit stays inside. An
// interval that is all outside becomes empty.
INLINE void outline_clip(__constant Scene *scene, vec3v point, real by_x, real by_y, realv *low, realv *high) {
    __constant OutlinePlane *plane = scene->outline.planes;
    for (int k = 0; k < (int)(sizeof(scene->outline.planes) / sizeof(OutlinePlane)); ++k) {
        const realv room = plane[k].distance - (plane[k].normal_x * point.x + plane[k].normal_y * point.y);
        const realv speed = plane[k].normal_x * by_x + plane[k].normal_y * by_y;   // towards the side; a mask per lane
        const realv meets = room / speed;
        *high = ((speed > 0) & (meets < *high)) ? meets : *high;
        *low = ((speed < 0) & (meets > *low)) ? meets : *low;
        *high = ((speed == 0) & (room < 0)) ? *low : *high;
    }
    *high = *high > *low ? *high : *low;
}
