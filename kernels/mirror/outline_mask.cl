// A mirror whose outline is a picture: one bit for each pixel. Frame: the mirror's. Unit: mm. Verb: see
// outline_polygon.cl; chords have no outline_clip here.
#include "simd_*.cl"

#define OUTLINE_BITS 16   // of a real of the tables, which holds such whole numbers exactly

// Clears `inside` where the point lies in no pixel that is set. tables: bits, row by row, from outline.first on.
INLINE void outline_limit(__constant Scene *scene, __global const real *tables, vec3v point, maskv *inside) {
    __constant Outline *outline = &scene->outline;
    realv column = (point.x - outline->low_x) * outline->inverse_pitch_x;
    realv row = (point.y - outline->low_y) * outline->inverse_pitch_y;
    const maskv within = (column >= 0) & (column < outline->columns) & (row >= 0) & (row < outline->rows);
    column = within ? column : (realv)(0);
    row = within ? row : (realv)(0);
    const intv pixel = to_int(row) * outline->columns + to_int(column);
    intv set = 0;
    for (int i = 0; i < WIDTH; ++i) {
        const int k = ((const int *)&pixel)[i];
        ((int *)&set)[i] = (int)tables[outline->first + k / OUTLINE_BITS] >> k % OUTLINE_BITS & 1;
    }
    *inside &= within & to_mask(set != 0);
}
