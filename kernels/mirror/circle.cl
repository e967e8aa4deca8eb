// Where a point that moves along a straight line crosses a circle about the z axis. Unit: mm.
#include "simd_*.cl"

// Parameters of the two crossings, the nearer to 0 first. Neither loses digits by cancellation.
typedef struct { realv near, far; } Crossing;

// For a point at radius r. growth: half the derivative of r^2 by the parameter; by2: square of the point's speed; room:
// radius^2 - r^2. If growth > 0 the point leaves the circle at `near` and entered it at `far`; if growth < 0 it enters
// at `near` and leaves at `far`. A line that misses the circle gets a leaving crossing before the entering one.
INLINE Crossing circle_crossing(realv growth, real by2, realv room) {
    const realv square = growth * growth + by2 * room;
    const realv root = real_sqrt(square > 0 ? square : (realv)(0));
    const realv sum = growth + (growth < 0 ? -root : root);
    return (Crossing){room / sum, -sum / by2};
}
