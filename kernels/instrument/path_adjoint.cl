// One adjoint path in stages: emit (detector pixel -> aperture -> line), mirror_meet, mirror_deviate, arrive (screen).
// Frames as in path_forward.cl. Unit: mm.
#include "arrival_*.cl"
#include "camera_*.cl"
#include "screen_*.cl"
#include "uniform.cl"
#include "sampler_*.cl"

// The dimensions of a ray's random words.
enum { ADJOINT_PIXEL_X, ADJOINT_PIXEL_Y, ADJOINT_APERTURE_RADIUS, ADJOINT_APERTURE_ANGLE };

// The ray's point on the camera's aperture, in the camera's frame.
INLINE void adjoint_aperture(__constant Scene *scene, const Words *words, int v, realv *a, realv *b) {
    unit_disk(ray_words(words, ADJOINT_APERTURE_RADIUS, v), ray_words(words, ADJOINT_APERTURE_ANGLE, v), a, b);
    *a *= scene->aperture_radius;
    *b *= scene->aperture_radius;
}

// Seen from aperture point a, the paraxial lens maps the upright image point X to the object-side slope
// a / focus - X / image_distance (light runs from the mirror to the camera).
// weight: cos^4 of the object-side angle times what distortion adds: the ray's flux relative to a ray along the axis.
INLINE Line adjoint_emit(__constant Scene *scene, const Receiver *receiver, const Words *words, int v, realv *weight) {
    realv a, b, image_x, image_y;
    adjoint_aperture(scene, words, v, &a, &b);
    const realv s = uniform_centred(ray_words(words, ADJOINT_PIXEL_X, v));
    const realv t = uniform_centred(ray_words(words, ADJOINT_PIXEL_Y, v));
    const realv stretch = camera_image(scene, receiver, s, t, &image_x, &image_y);
    const realv slope_a = a * scene->inverse_focus - image_x * scene->inverse_image_distance;
    const realv slope_b = b * scene->inverse_focus - image_y * scene->inverse_image_distance;
    const realv cosine2 = 1 / (1 + slope_a * slope_a + slope_b * slope_b);
    *weight = cosine2 * cosine2 * stretch;
    return frame_depart(&scene->camera, a, b, slope_a, slope_b, (realv)(1));
}

// The place on the screen's grid of pixels that the ray lights. Returns false if the ray runs away from the screen.
INLINE maskv adjoint_arrive(__constant Scene *scene, const Receiver *receiver, const Line *line, const Meeting *met,
                            realv *u, realv *v) {
    realv slope_u, slope_v;
    const maskv ahead = reflected_arrive(scene, &scene->screen, line, met, u, v, &slope_u, &slope_v);
    return screen_meet(scene, receiver, ahead, slope_u, slope_v, u, v);
}
