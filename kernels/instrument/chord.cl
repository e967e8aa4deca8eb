// The chord of an adjoint ray through the camera's aperture, and its light along one axis of the screen, in lines.
// Frames and stages as in path_adjoint.cl. Lengths on the aperture and the mirror in mm, on the screen in lines.
#include "reflection.cl"

// The light below a line's edge, as a function of the edge, is a ramp: it rises with constant slope from low to high.
// slope: fixed point, per line; 0 without light.
typedef struct { realv low, high, slope; } Ramp;

#define MIN_RAMP (real)0.015625           // lines; shorter ramps are widened about their middle

// The light of a chord: its centroid, half its length on the screen, and its fixed-point amount per line.
typedef struct { realv centre, extent, density; } ChordLight;

// Of a chord that no edge of the mirror cuts. along: of the ray's point on its chord, from the chord's middle.
INLINE ChordLight chord_whole(const Chord *chord, realv along, realv half_length, realv at, realv weight,
                              realv min_width) {
    const realv reach = chord->slope * half_length, least = (real)0.5 * min_width;
    const realv extent = reach > least ? reach : least;
    const realv rise = (chord->slope * chord->growth + chord->bend) * (real)(1.0 / 3.0);
    const realv centre = at - along * (chord->slope + chord->bend * along) + rise * half_length * half_length;
    return (ChordLight){centre, extent, weight * (1 - chord->growth * along) / (2 * extent)};
}

// Of a chord that the mirror's edges may cut, where the point that `met` moves along the mirror leaves it.
INLINE ChordLight chord_cut(__constant Scene *scene, const Chord *chord, const Meeting *met, realv along,
                            realv half_length, realv at, realv weight, realv min_width) {
    realv low = -half_length - along, high = half_length - along;
    aperture_clip(&scene->mirror, met->point, chord->mirror_x, chord->mirror_y, &low, &high);
    outline_clip(scene, met->point, chord->mirror_x, chord->mirror_y, &low, &high);
    const realv middle = (real)0.5 * (low + high), half_piece = (real)0.5 * (high - low);
    const realv least = min_width / (2 * half_length);
    const realv slope = chord->slope;
    // the centroid of the light, not the middle of the piece: the map bends and cos^4 grows along the chord
    const realv centre = at + (slope + 2 * chord->bend * along) * middle + chord->bend * middle * middle
                         + (slope * chord->growth + chord->bend) * half_piece * half_piece * (real)(1.0 / 3.0);
    realv stretch = slope + 2 * chord->bend * (along + middle);
    stretch = stretch < 0 ? -stretch : stretch;               // negative beyond a fold of a strongly bent map
    const realv extent = (stretch > least ? stretch : least) * half_piece;
    return (ChordLight){centre, extent,
                        weight * (1 + chord->growth * middle) * half_piece / (2 * half_length * extent)};
}

// The ramp of a ray that leaves the aperture at (a, b), meets the mirror at `met`, and lands at `at` lines from the
// first line of its window, which is line `start` of the screen. weight: fixed point; 0 for light that misses the
// screen along the other axis. cut: whether the mirror's edges may cut the chord. Returns true where light falls on the
// screen but outside the window.
INLINE maskv chord_ramp(__constant Scene *scene, const Chord *chord, const Meeting *met, realv a, realv b, realv at,
                        realv weight, int start, int lines, int screen_lines, bool cut, Ramp *ramp) {
    const realv along = chord->normal_a * a + chord->normal_b * b;
    const real least2 = scene->aperture_radius2 * (real)1e-8;
    const realv half2 = scene->aperture_radius2 - (a * a + b * b) + along * along;
    const realv half_length = real_sqrt(half2 > least2 ? half2 : (realv)(least2));
    // a ramp is also widened if the slope of a heavy ray would not fit 31 bits
    const realv width = weight * (real)0x1p-30 > MIN_RAMP ? weight * (real)0x1p-30 : (realv)(MIN_RAMP);
    const ChordLight light = cut ? chord_cut(scene, chord, met, along, half_length, at, weight, width)
                                 : chord_whole(chord, along, half_length, at, weight, width);
    const maskv lit = (light.density > 0) & (light.centre == light.centre);
    realv low = light.centre - light.extent, high = light.centre + light.extent;
    low = low > -start ? low : (realv)(-start);
    high = high > -start ? high : (realv)(-start);
    low = low < screen_lines - start ? low : (realv)(screen_lines - start);
    high = high < screen_lines - start ? high : (realv)(screen_lines - start);
    *ramp = (Ramp){lit ? low : (realv)(0), lit ? high : (realv)(0), lit ? light.density : (realv)(0)};
    return ((low < 0) | (high > lines)) & lit;
}
