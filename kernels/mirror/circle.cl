// Where a point that moves along a straight line crosses a circle about the z axis. Lengths in mm.
#include "simd_*.cl"

// Parameters of the two crossings: of the one next to 0, and of the other; both exact.
typedef struct { realv near, far; } Crossing;

// For a point at radius r. growth: half of r^2's derivative by the parameter; by2: the square of the point's speed; room:
// radius^2 - r^2. Where growth > 0 the point leaves the circle at `near` and has entered it at `far`, where growth < 0 it
// enters at `near` and leaves at `far`. A line that passes the circle by leaves before it enters.
INLINE Crossing circle_crossing(realv growth, real by2, realv room) {
    const realv square = growth * growth + by2 * room;
    const realv root = real_sqrt(square > 0 ? square : (realv)(0));
    const realv sum = growth + (growth < 0 ? -root : root);
    return (Crossing){room / sum, -sum / by2};
}
