// How far the mirror as made lies above its quadric, along z: the sum of the kinds of departure that a scene has. Each
// kind's file of the family *_none.cl adds nothing. Frame: the mirror's. Unit: mm.
#include "zernike_*.cl"
#include "polynomial_*.cl"
#include "asphere_*.cl"

// At (x, y). tables: what is too large for the scene's structure.
INLINE void mirror_departure(__constant Scene *scene, __global const real *tables, realv x, realv y, realv *height,
                             realv *slope_x, realv *slope_y) {
    *height = *slope_x = *slope_y = 0;
    zernike_add(scene, x, y, height, slope_x, slope_y);
    polynomial_add(scene, x, y, height, slope_x, slope_y);
    asphere_add(scene, x, y, height, slope_x, slope_y);
}
