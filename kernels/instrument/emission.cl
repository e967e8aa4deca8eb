// Lambertian emission of a screen pixel, aimed at the mirror. Frame: the screen's. Unit: mm.
#include "uniform.cl"
#include "sampler_*.cl"

// The dimensions of a ray's random words.
enum { FORWARD_PIXEL_X, FORWARD_PIXEL_Y, FORWARD_AIM_RADIUS, FORWARD_AIM_ANGLE };

// Direction cosines in the screen's frame.
typedef struct { realv l, m; } Direction;

// For Lambertian emission the flux per direction-cosine area dl dm is constant. So directions that are uniform in the
// aim's ellipse all carry the same flux: radiance x pixel area x ellipse area / rays.
INLINE Direction aim_of(const Emitter *emitter, uintv radius_word, uintv angle_word) {
    realv x, y;
    unit_disk(radius_word, angle_word, &x, &y);
    return (Direction){emitter->centre_l + emitter->aim_ll * x,
                       emitter->centre_m + emitter->aim_ml * x + emitter->aim_mm * y};
}

INLINE Direction forward_aim(const Emitter *emitter, const Words *words, int v) {
    return aim_of(emitter, ray_words(words, FORWARD_AIM_RADIUS, v), ray_words(words, FORWARD_AIM_ANGLE, v));
}
