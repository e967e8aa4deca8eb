// The chord of an adjoint ray through the camera's aperture, and its light along one axis of the screen, in lines.
// Frames and stages as in path_adjoint.cl. Lengths on the aperture and the mirror in mm, on the screen in lines.
#include "reflection.cl"

// The light below a line's edge, as a function of the edge, is a ramp: it rises with constant slope between two places.
// Sampled at the lines' edges, its second differences are four numbers: slope - upper and upper at bin and bin + 1 of
// the first place, and their negatives at the second. They are whole numbers, so they cancel exactly.
typedef struct { intv bin[2], upper[2], slope; } Ramp;

#define MIN_RAMP (real)0.015625           // lines; shorter ramps are widened about their middle

// The ramp of a ray that leaves the aperture at (a, b), meets the mirror at `met`, and lands at `at` lines from the
// first line of its window, which is line `start` of the screen. weight: fixed point; 0 for light that misses the
// screen along the other axis. Returns true where light falls on the screen but outside the window.
INLINE maskv chord_ramp(__constant Scene *scene, const Chord *chord, const Meeting *met, realv a, realv b, realv at,
                        realv weight, int start, int lines, int screen_lines, Ramp *ramp) {
    const realv along = chord->normal_a * a + chord->normal_b * b;
    const real least2 = scene->aperture_radius2 * (real)1e-8;
    const realv half2 = scene->aperture_radius2 - (a * a + b * b) + along * along;
    const realv half_length = real_sqrt(half2 > least2 ? half2 : (realv)(least2));
    realv low = -half_length - along, high = half_length - along;
    aperture_clip(&scene->mirror, met->point, chord->mirror_x, chord->mirror_y, &low, &high);
    outline_clip(scene, met->point, chord->mirror_x, chord->mirror_y, &low, &high);
    const realv middle = (real)0.5 * (low + high), half_piece = (real)0.5 * (high - low);
    // a ramp is also widened if the slope of a heavy ray would not fit 31 bits
    const realv width = weight * (real)0x1p-30 > MIN_RAMP ? weight * (real)0x1p-30 : (realv)(MIN_RAMP);
    const realv least = width / (2 * half_length);
    const realv slope = chord->slope;
    // the centroid of the light, not the middle of the piece: the map bends and cos^4 grows along the chord
    const realv centre = at + (slope + 2 * chord->bend * along) * middle + chord->bend * middle * middle
                         + (slope * chord->growth + chord->bend) * half_piece * half_piece * (real)(1.0 / 3.0);
    realv stretch = slope + 2 * chord->bend * (along + middle);
    stretch = stretch < 0 ? -stretch : stretch;               // negative beyond a fold of a strongly bent map
    const realv extent = (stretch > least ? stretch : least) * half_piece;
    const realv density = weight * (1 + chord->growth * middle) * half_piece / (2 * half_length * extent);
    const maskv lit = (density > 0) & (centre == centre);
    ramp->slope = to_int(lit ? density + (real)0.5 : (realv)(0));
    maskv beyond = 0;
    const realv place[2] = {centre - extent, centre + extent};
    for (int end = 0; end < 2; ++end) {
        realv p = lit ? place[end] : (realv)(0);
        p = p > -start ? p : (realv)(-start);
        p = p < screen_lines - start ? p : (realv)(screen_lines - start);
        beyond |= (p < 0) | (p > lines);
        p = p > 0 ? p : (realv)(0);
        p = p < lines ? p : (realv)(lines);
        ramp->bin[end] = to_int(p);
        ramp->upper[end] = to_int((p - to_real(ramp->bin[end])) * to_real(ramp->slope) + (real)0.5);
    }
    return beyond & lit;
}
