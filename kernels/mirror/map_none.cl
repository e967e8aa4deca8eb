// No height map. The same verb as map_bicubic.cl.
INLINE void map_add(__constant Scene *scene, __global const real *tables, realv x_mm, realv y_mm, realv *sum,
                    realv *slope_x, realv *slope_y) {}
