// One adjoint path: detector pixel -> camera aperture -> mirror -> screen. Frames as in path_forward.cl.
#include "mirror_*.cl"
#include "reflect.cl"
#include "device_frame.cl"
#include "uniform.cl"
#include "sampler_*.cl"

// The named dimensions: words of sample_words.
enum { ADJOINT_PIXEL_X, ADJOINT_PIXEL_Y, ADJOINT_APERTURE_RADIUS, ADJOINT_APERTURE_ANGLE };

typedef struct {
    vec3v start_world, point_world;       // on the aperture, on the mirror
    realv weight;                         // cos^4 of the object-side angle: the pixel's flux per ray relative to the axis
    realv u, v;                           // on the screen's plane, in the screen's frame
    maskv on_mirror, ahead;               // met the mirror's aperture; runs towards the screen's plane
} PathAdjoint;

// pixel_x, pixel_y: the pixel's centre on the upright image (x to +x of the mirror), mm.
// The paraxial lens turns the upright image point X seen from aperture point a into the object-side slope
// a / focus - X / image_distance (light running from the mirror to the camera).
INLINE PathAdjoint path_adjoint(__constant Scene *scene, real pixel_x, real pixel_y, Philox words) {
    PathAdjoint path;
    realv a, b, x0, y0, p, q, slope_u, slope_v;
    vec3v normal;
    unit_disk(words.word[ADJOINT_APERTURE_RADIUS], words.word[ADJOINT_APERTURE_ANGLE], &a, &b);
    a *= scene->aperture_radius;
    b *= scene->aperture_radius;
    const realv image_x = pixel_x + scene->detector_pitch * uniform_centred(words.word[ADJOINT_PIXEL_X]);
    const realv image_y = pixel_y + scene->detector_pitch * uniform_centred(words.word[ADJOINT_PIXEL_Y]);
    const realv slope_a = a * scene->inverse_focus - image_x * scene->inverse_image_distance;
    const realv slope_b = b * scene->inverse_focus - image_y * scene->inverse_image_distance;
    const realv cosine2 = 1 / (1 + slope_a * slope_a + slope_b * slope_b);
    path.weight = cosine2 * cosine2;
    frame_depart(&scene->camera, a, b, slope_a, slope_b, (realv)(1), &path.start_world, &x0, &y0, &p, &q);
    path.on_mirror = mirror_meet(scene, x0, y0, p, q, &path.point_world, &normal);
    const vec3v outgoing = reflect((vec3v){p, q, (realv)(1)}, normal);
    path.ahead = frame_arrive(&scene->screen, path.point_world, outgoing, &path.u, &path.v, &slope_u, &slope_v);
    return path;
}
