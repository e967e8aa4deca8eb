// The chord of an adjoint ray through the camera's aperture and the light it sends along one axis of the screen, in lines.
// Frames and stages as in path_adjoint.cl. Lengths on the aperture and the mirror in mm, on the screen in lines.
#include "reflection.cl"

// Light below a line's edge as a function of the edge is a ramp: it rises with a slope between two places. Sampled at the
// lines' edges its second differences are four numbers: slope - upper and upper at bin and bin + 1 of the first place,
// the negatives at the second. Whole numbers, so that what is put on is taken off exactly.
typedef struct { intv bin[2], upper[2], slope; } Ramp;

#define MIN_RAMP (real)0.015625           // lines; shorter ramps are widened about their middle

// The ramp of the ray that lands at `at` lines from its window's first (number `start` on the screen), having met the
// mirror at `met` and left from the aperture's point (a, b). weight: fixed point; 0 for light that the screen's other axis
// cuts off. Returns true where light falls on the screen beside the window.
INLINE maskv chord_ramp(__constant Scene *scene, const Chord *chord, const Meeting *met, realv a, realv b, realv at,
                        realv weight, int start, int lines, int screen_lines, Ramp *ramp) {
    const realv along = chord->normal_a * a + chord->normal_b * b;
    const real least2 = scene->aperture_radius2 * (real)1e-8;
    const realv half2 = scene->aperture_radius2 - (a * a + b * b) + along * along;
    const realv half_length = real_sqrt(half2 > least2 ? half2 : (realv)(least2));
    realv low = -half_length - along, high = half_length - along;
    aperture_clip(&scene->mirror, met->point, chord->mirror_x, chord->mirror_y, &low, &high);
    const realv middle = (real)0.5 * (low + high), l1_norm = (real)0.5 * (high - low);
    // a ramp so short that the slope of a heavy ray would leave 31 bits is widened, too
    const realv width = weight * (real)0x1p-30 > MIN_RAMP ? weight * (real)0x1p-30 : (realv)(MIN_RAMP);
    const realv least = width / (2 * half_length);
    const realv slope = chord->slope;
    // the centre is that of the light, not of the piece's ends: the map bends and cos^4 grows along the chord
    const realv centre = at + (slope + 2 * chord->bend * along) * middle + chord->bend * middle * middle
                         + (slope * chord->growth + chord->bend) * l1_norm * l1_norm * (real)(1.0 / 3.0);
    realv stretch = slope + 2 * chord->bend * (along + middle);
    stretch = stretch < 0 ? -stretch : stretch;               // beyond a fold, which a strongly bent map has
    const realv extent = (stretch > least ? stretch : least) * l1_norm;
    const realv density = weight * (1 + chord->growth * middle) * l1_norm / (2 * half_length * extent);
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
