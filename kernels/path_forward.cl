// One forward path in three stages: emit (screen -> line), mirror_reflect, arrive (camera's aperture).
// Frames: world = the mirror's; screen's and camera's own.
#include "reflection.cl"
#include "device_frame.cl"
#include "uniform.cl"
#include "sampler_*.cl"

// The named dimensions of a ray's words.
enum { FORWARD_PIXEL_X, FORWARD_PIXEL_Y, FORWARD_AIM_RADIUS, FORWARD_AIM_ANGLE };

// At the camera's aperture plane, in the camera's frame: position and slopes; and how the ray fared there.
typedef struct { realv a, b, slope_a, slope_b; maskv through, clipped; } Arrival;

// Lambertian emission: flux per direction-cosine area dl dm is constant, so directions uniform in the aim's ellipse all
// carry the same flux, radiance x pixel area x ellipse area / rays.
INLINE Line forward_emit(__constant Scene *scene, const Emitter *emitter, const Words *words, int v) {
    realv disk_x, disk_y;
    unit_disk(ray_words(words, FORWARD_AIM_RADIUS, v), ray_words(words, FORWARD_AIM_ANGLE, v), &disk_x, &disk_y);
    const realv l = emitter->centre_l + emitter->aim_ll * disk_x;
    const realv m = emitter->centre_m + emitter->aim_ml * disk_x + emitter->aim_mm * disk_y;
    const realv n = real_sqrt(1 - l * l - m * m);
    return frame_depart(&scene->screen,
                        emitter->x + scene->screen_pitch * uniform_centred(ray_words(words, FORWARD_PIXEL_X, v)),
                        emitter->y + scene->screen_pitch * uniform_centred(ray_words(words, FORWARD_PIXEL_Y, v)),
                        l, m, -n);
}

INLINE Arrival forward_arrive(__constant Scene *scene, const Reflection *ray) {
    Arrival at;
    const maskv ahead = frame_arrive(&scene->camera, ray->point, ray->direction, &at.a, &at.b, &at.slope_a, &at.slope_b);
    const realv radius2 = at.a * at.a + at.b * at.b;
    at.through = ray->on_mirror & ahead & (radius2 <= scene->aperture_radius2);
    at.clipped = ray->on_mirror & (!ahead | (radius2 > scene->aperture_radius2));
    return at;
}
