// From the quadric to a mirror whose departure is slight: the quadric is as good as level over the way. The first step
// moves along the line by the height; further steps only refine the point at which the departure is evaluated. Frame:
// the mirror's. Unit: mm.

// Follows the line from its point `base` of the quadric, with the quadric's normal there, to the surface. The departure
// and its slopes are those before the last step. The host chooses the number of steps, a constant.
INLINE void mirror_approach(__constant Scene *scene, __global const real *tables, const Line *line, vec3v base,
                            vec3v normal, Meeting *at) {
    const realv approach = normal.z / (normal.z + line->p * normal.x + line->q * normal.y);
    for (int step = 0; step < newton_steps[0]; ++step) {
        mirror_departure(scene, tables, at->point.x, at->point.y, &at->height, &at->slope_x, &at->slope_y);
        const realv dz = at->height * approach;
        at->point = (vec3v){base.x + line->p * dz, base.y + line->q * dz, base.z + dz};
    }
}
