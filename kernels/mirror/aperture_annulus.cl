// Mirror aperture: a disk about the z axis with a central hole. Frame: the mirror's. Unit: mm.
#include "circle.cl"

INLINE maskv aperture_contains(__constant Mirror *mirror, vec3v point) {
    const realv radius2 = point.x * point.x + point.y * point.y;
    return (radius2 <= mirror->aperture_radius2) & (radius2 >= mirror->obscuration_radius2);
}

// As in aperture_disk.cl. Outside means beyond the rim or within the hole. If an interval has the hole in its middle,
// the piece beyond the hole stays.
INLINE void aperture_clip(__constant Mirror *mirror, vec3v point, real by_x, real by_y, realv *low, realv *high) {
    const realv radius2 = point.x * point.x + point.y * point.y;
    const realv growth = point.x * by_x + point.y * by_y;
    const real by2 = by_x * by_x + by_y * by_y;
    const Crossing rim = circle_crossing(growth, by2, mirror->aperture_radius2 - radius2);
    const Crossing hole = circle_crossing(growth, by2, mirror->obscuration_radius2 - radius2);
    const maskv meets = growth * growth + by2 * (mirror->obscuration_radius2 - radius2) >= 0;  // the hole
    const realv enters = growth > 0 ? rim.far : rim.near, leaves = growth > 0 ? rim.near : rim.far;
    *high = ((growth != 0) & (leaves < *high)) ? leaves : *high;
    *low = ((growth != 0) & (enters > *low)) ? enters : *low;
    *low = ((growth > 0) & meets & (hole.near > *low)) ? hole.near : *low;
    *high = ((growth < 0) & meets & (hole.near < *high)) ? hole.near : *high;
    const maskv outside = (radius2 > mirror->aperture_radius2) | (radius2 < mirror->obscuration_radius2);
    *high = ((growth == 0) & outside) ? *low : *high;
    *high = *high > *low ? *high : *low;
}
