// The mirror as made: the design surface plus a Zernike deviation along z, carried apart so that neither loses digits.
#include "surface_*.cl"
#include "aperture_*.cl"
#include "zernike.cl"

// As in mirror_nominal.cl. From the point on the design surface the line is followed to the deviated one by Newton
// steps (mirror->newton_steps, chosen on the host from the deviation's size): the first moves along the line by the
// height over its slope against the surface, further ones only refine the deviation's own argument.
INLINE maskv mirror_meet(__constant Scene *scene, realv x0, realv y0, realv p, realv q, vec3v *point, vec3v *normal) {
    __constant Mirror *mirror = &scene->mirror;
    const maskv met = surface_meet(mirror, x0, y0, p, q, point);
    const vec3v base = *point;
    const vec3v base_normal = surface_normal(mirror, base);
    const realv approach = base_normal.z / (base_normal.z + p * base_normal.x + q * base_normal.y);
    realv height, slope_x, slope_y;
    for (int step = 0; step < mirror->newton_steps; ++step) {
        height = zernike_deviation(&scene->zernike, point->x, point->y, &slope_x, &slope_y);
        const realv dz = height * approach;
        *point = (vec3v){base.x + p * dz, base.y + q * dz, base.z + dz};
    }
    *normal = surface_normal(mirror, (vec3v){point->x, point->y, point->z - height});   // the design's, under the point
    normal->x -= slope_x * normal->z;
    normal->y -= slope_y * normal->z;
    return met & aperture_contains(mirror, *point);
}
