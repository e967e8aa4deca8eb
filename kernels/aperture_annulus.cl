// Mirror aperture: a disk about the z axis with a central hole. Unit: mm.
#include "simd_*.cl"

INLINE maskv aperture_contains(__constant Mirror *mirror, vec3v point) {
    const realv radius2 = point.x * point.x + point.y * point.y;
    return (radius2 <= mirror->aperture_radius2) & (radius2 >= mirror->obscuration_radius2);
}

// As in aperture_disk.cl: outside means beyond the rim or within the hole.
INLINE void aperture_clip(__constant Mirror *mirror, vec3v point, real by_x, real by_y, realv *low, realv *high) {
    const realv radius2 = point.x * point.x + point.y * point.y;
    const realv growth = 2 * (point.x * by_x + point.y * by_y);
    const realv rim = (mirror->aperture_radius2 - radius2) / growth, hole = (mirror->obscuration_radius2 - radius2) / growth;
    const realv most = growth > 0 ? rim : hole, least = growth > 0 ? hole : rim;
    const maskv moves = growth != 0;
    *high = (moves & (most < *high)) ? most : *high;
    *low = (moves & (least > *low)) ? least : *low;
    const maskv outside = (radius2 > mirror->aperture_radius2) | (radius2 < mirror->obscuration_radius2);
    *high = ((growth == 0) & outside) ? *low : *high;
    *high = *high > *low ? *high : *low;
}
