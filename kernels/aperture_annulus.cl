// Mirror aperture: a disk about the z axis with a central hole. Unit: mm.
#include "simd_*.cl"

INLINE maskv aperture_contains(__constant Mirror *mirror, vec3v point) {
    const realv radius2 = point.x * point.x + point.y * point.y;
    return (radius2 <= mirror->aperture_radius2) & (radius2 >= mirror->obscuration_radius2);
}
