// A flat screen: its pixels lie in its frame's plane z = 0. Frame: the screen's. Unit: mm.
#include "device_frame.cl"
#include "glass_*.cl"

// The line of a ray that leaves an emitter at (s, t) pixels from its centre in the direction (l, m, -n).
INLINE Line screen_emit(__constant Scene *scene, const Emitter *emitter, realv s, realv t, realv l, realv m, realv n) {
    realv u = emitter->x + scene->screen_pitch_x * s;
    realv v = emitter->y + scene->screen_pitch_y * t;
    glass_leave(scene, l, m, n, &u, &v);
    return frame_depart(&scene->screen, u, v, l, m, -n);
}

// From where a receiver's ray crosses the frame's plane, with slopes du/dz, dv/dz, to the place on the grid of pixels
// that it lights. Returns false if the ray comes from behind; ahead: it does not run away from the frame's plane.
INLINE maskv screen_meet(__constant Scene *scene, const Receiver *receiver, maskv ahead, realv slope_u, realv slope_v,
                         realv *u, realv *v) {
    glass_enter(scene, slope_u, slope_v, u, v);
    return ahead;
}
