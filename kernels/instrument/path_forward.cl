// One forward path in stages: aim and emit (screen -> line), mirror_meet, mirror_deviate, arrive (camera's aperture).
// Frames: the world's, which is the mirror's; the screen's and the camera's own. Unit: mm.
#include "arrival_*.cl"
#include "screen_*.cl"
#include "emission.cl"

// Position and slopes in the camera's aperture plane, in the camera's frame.
typedef struct { realv a, b, slope_a, slope_b; } Arrival;

INLINE Line forward_emit(__constant Scene *scene, const Emitter *emitter, const Direction *aim, const Words *words,
                         int v) {
    const realv n = real_sqrt(1 - aim->l * aim->l - aim->m * aim->m);
    return screen_emit(scene, emitter, uniform_centred(ray_words(words, FORWARD_PIXEL_X, v)),
                       uniform_centred(ray_words(words, FORWARD_PIXEL_Y, v)), aim->l, aim->m, n);
}

// through: passed the aperture; clipped: missed it after meeting the mirror.
INLINE Arrival forward_arrive(__constant Scene *scene, const Line *line, const Meeting *met, maskv *through,
                              maskv *clipped) {
    Arrival at;
    const maskv ahead = reflected_arrive(scene, &scene->camera, line, met, &at.a, &at.b, &at.slope_a, &at.slope_b);
    const realv radius2 = at.a * at.a + at.b * at.b;
    *through = met->on_mirror & ahead & (radius2 <= scene->aperture_radius2);
    *clipped = met->on_mirror & (!ahead | (radius2 > scene->aperture_radius2));
    return at;
}
