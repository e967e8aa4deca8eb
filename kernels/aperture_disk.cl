// Mirror aperture: a disk about the z axis. Unit: mm.
#include "simd_*.cl"

INLINE maskv aperture_contains(__constant Mirror *mirror, vec3v point) {
    return point.x * point.x + point.y * point.y <= mirror->aperture_radius2;
}
