// One forward path: screen pixel -> mirror -> camera aperture. Frames: world = the mirror's; screen's and camera's own.
#include "mirror_*.cl"
#include "reflect.cl"
#include "device_frame.cl"
#include "uniform.cl"
#include "sampler_*.cl"

// The named dimensions: words of sample_words.
enum { FORWARD_PIXEL_X, FORWARD_PIXEL_Y, FORWARD_AIM_RADIUS, FORWARD_AIM_ANGLE };

typedef struct {
    vec3v start_world, point_world;       // on the screen, on the mirror
    realv a, b, slope_a, slope_b;         // on the camera's aperture plane: position and slopes in the camera's frame
    maskv on_mirror, through;             // met the mirror's aperture; and then went through the camera's
} PathForward;

// Lambertian emission: flux per direction-cosine area dl dm is constant, so directions uniform in the aim's ellipse all
// carry the same flux, radiance x pixel area x ellipse area / rays.
INLINE PathForward path_forward(__constant Scene *scene, const Emitter *emitter, Philox words) {
    PathForward path;
    realv disk_x, disk_y, x0, y0, p, q;
    vec3v normal;
    unit_disk(words.word[FORWARD_AIM_RADIUS], words.word[FORWARD_AIM_ANGLE], &disk_x, &disk_y);
    const realv l = emitter->centre_l + emitter->aim_ll * disk_x;
    const realv m = emitter->centre_m + emitter->aim_ml * disk_x + emitter->aim_mm * disk_y;
    const realv n = real_sqrt(1 - l * l - m * m);
    frame_depart(&scene->screen,
                 emitter->x + scene->screen_pitch * uniform_centred(words.word[FORWARD_PIXEL_X]),
                 emitter->y + scene->screen_pitch * uniform_centred(words.word[FORWARD_PIXEL_Y]),
                 l, m, -n, &path.start_world, &x0, &y0, &p, &q);
    path.on_mirror = mirror_meet(scene, x0, y0, p, q, &path.point_world, &normal);
    const vec3v outgoing = reflect((vec3v){p, q, (realv)(1)}, normal);
    const maskv ahead = frame_arrive(&scene->camera, path.point_world, outgoing,
                                     &path.a, &path.b, &path.slope_a, &path.slope_b);
    path.through = path.on_mirror & ahead & (path.a * path.a + path.b * path.b <= scene->aperture_radius2);
    return path;
}
