// One forward path in stages: aim and emit (screen -> line), mirror_meet, mirror_deviate, arrive (camera's aperture).
// Frames: world = the mirror's; screen's and camera's own.
#include "arrival_*.cl"
#include "uniform.cl"
#include "sampler_*.cl"

// The named dimensions of a ray's words.
enum { FORWARD_PIXEL_X, FORWARD_PIXEL_Y, FORWARD_AIM_RADIUS, FORWARD_AIM_ANGLE };

// At the camera's aperture plane, in the camera's frame: position and slopes; and how the ray fared there.
typedef struct { realv a, b, slope_a, slope_b; maskv through, clipped; } Arrival;

// Direction cosines in the screen's frame.
typedef struct { realv l, m; } Direction;

// Lambertian emission: flux per direction-cosine area dl dm is constant, so directions uniform in the aim's ellipse all
// carry the same flux, radiance x pixel area x ellipse area / rays.
INLINE Direction forward_aim(const Emitter *emitter, const Words *words, int v) {
    realv x, y;
    unit_disk(ray_words(words, FORWARD_AIM_RADIUS, v), ray_words(words, FORWARD_AIM_ANGLE, v), &x, &y);
    return (Direction){emitter->centre_l + emitter->aim_ll * x,
                       emitter->centre_m + emitter->aim_ml * x + emitter->aim_mm * y};
}

INLINE Line forward_emit(__constant Scene *scene, const Emitter *emitter, const Direction *aim, const Words *words,
                         int v) {
    const realv n = real_sqrt(1 - aim->l * aim->l - aim->m * aim->m);
    return frame_depart(&scene->screen,
                        emitter->x + scene->screen_pitch * uniform_centred(ray_words(words, FORWARD_PIXEL_X, v)),
                        emitter->y + scene->screen_pitch * uniform_centred(ray_words(words, FORWARD_PIXEL_Y, v)),
                        aim->l, aim->m, -n);
}

INLINE Arrival forward_arrive(__constant Scene *scene, const Line *line, const Meeting *met) {
    Arrival at;
    const maskv ahead = reflected_arrive(scene, &scene->camera, line, met, &at.a, &at.b, &at.slope_a, &at.slope_b);
    const realv radius2 = at.a * at.a + at.b * at.b;
    at.through = met->on_mirror & ahead & (radius2 <= scene->aperture_radius2);
    at.clipped = met->on_mirror & (!ahead | (radius2 > scene->aperture_radius2));
    return at;
}
