// A mirror whose outline is the union of parts without strips: any polygons, disks and rings. Frame: the mirror's.
// Unit: mm. Verb: see outline_polygon.cl; chords have no outline_clip here, because they may be cut into pieces.
#include "simd_*.cl"

// Whether a point lies in a part: on the ring, or on a polygon, where a ray towards +x crosses an odd number of sides.
// A side has its lower end and belongs to the points at or above it, so that sides of two parts leave no gap.
INLINE maskv outline_part_contains(__constant Scene *scene, __constant OutlinePart *part, vec3v point) {
    if (part->side_count == 0) {
        const realv x = point.x - part->x, y = point.y - part->y, radius2 = x * x + y * y;
        return (radius2 <= part->outer2) & (radius2 >= part->inner2);
    }
    __constant OutlineSide *side = scene->outline.sides + part->first_side;
    maskv odd = 0;
    for (int k = 0; k < part->side_count; ++k)
        odd ^= (point.y >= side[k].low_y) & (point.y < side[k].high_y)
               & (point.x < side[k].low_x + (point.y - side[k].low_y) * side[k].slope);
    return odd;
}

// Clears `inside` where the point lies in none of the parts, or in a strip. tables: not used.
INLINE void outline_limit(__constant Scene *scene, __global const real *tables, vec3v point, maskv *inside) {
    __constant OutlinePart *part = scene->outline.parts;
    const int parts = scene->outline.part_count, strips = scene->outline.strip_count;
    maskv within = 0;
    for (int k = 0; k < parts; ++k) within |= outline_part_contains(scene, &part[k], point);
    if (parts > 0) *inside &= within;
    for (int k = 0; k < strips; ++k) *inside &= !outline_part_contains(scene, &part[parts + k], point);
}
