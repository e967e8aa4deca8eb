// From the quadric to a mirror whose design departs from it by any amount: Newton's method, with the departure's slopes
// and the quadric's bend, from nearly the right height on. The same verb as approach_slight.cl. Frame: the mirror's. Unit: mm.
//
// A point d away from the line's point of the quadric is on the surface where n . d' = d' . B d' / 2, d' = d - (0, 0,
// height), with the quadric's normal n at that point and its form B. All terms have the size of the departure: single
// precision loses nothing to the sag.

INLINE void mirror_approach(__constant Scene *scene, __global const real *tables, const Line *line, vec3v base,
                            vec3v normal, Meeting *at) {
    const real q_xx = scene->mirror.q_xx, q_yy = scene->mirror.q_yy;
    const real q_zz = scene->mirror.q_zz, q_xz = scene->mirror.q_xz;
    const real one_half = 0.5f;
    const realv level_rise = normal.x * line->p + normal.y * line->q + normal.z;
    realv dz = asphere_guess(scene, base.x, base.y) * (normal.z / level_rise);
    at->point = (vec3v){base.x + line->p * dz, base.y + line->q * dz, base.z + dz};
    for (int step = 0; step < newton_steps[0]; ++step) {
        mirror_departure(scene, tables, at->point.x, at->point.y, &at->height, &at->slope_x, &at->slope_y);
        const realv dx = line->p * dz, dy = line->q * dz, du = dz - at->height;
        const vec3v half_bend = {one_half * (q_xx * dx + q_xz * du), one_half * (q_yy * dy),
                                 one_half * (q_zz * du + q_xz * dx)};
        const vec3v middle = {normal.x - half_bend.x, normal.y - half_bend.y, normal.z - half_bend.z};
        const realv left = middle.x * dx + middle.y * dy + middle.z * du;
        const realv level = 1 - line->p * at->slope_x - line->q * at->slope_y;
        const realv rise = (middle.x - half_bend.x) * line->p + (middle.y - half_bend.y) * line->q +
                           (middle.z - half_bend.z) * level;
        const realv move = left / rise;
        dz -= move;
        at->height -= move * (line->p * at->slope_x + line->q * at->slope_y);   // where the line is now
        at->point = (vec3v){base.x + line->p * dz, base.y + line->q * dz, base.z + dz};
    }
}
