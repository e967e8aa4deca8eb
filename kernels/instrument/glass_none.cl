// A screen without a cover glass. The verbs are those of glass_plate.cl, which do nothing here.
#include "simd_*.cl"

INLINE void glass_leave(__constant Scene *scene, realv l, realv m, realv n, realv *u, realv *v) {}
INLINE void glass_enter(__constant Scene *scene, realv slope_u, realv slope_v, realv *u, realv *v) {}
INLINE void glass_enter_bent(__constant Scene *scene, vec3v along_u, vec3v along_v, realv slope_u, realv slope_v,
                             realv *u, realv *v) {}
