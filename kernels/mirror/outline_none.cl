// A mirror that is its whole aperture. The same verbs as outline_polygon.cl.
INLINE void outline_limit(__constant Scene *scene, __global const real *tables, vec3v point, maskv *inside) {}

INLINE void outline_clip(__constant Scene *scene, vec3v point, real by_x, real by_y, realv *low, realv *high) {}
