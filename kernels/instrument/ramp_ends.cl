// The two ends of a ramp among the lines of a window, in whole numbers. Lengths in lines.
#include "chord.cl"

// Sampled at the lines' edges, a ramp's second differences are four numbers: slope - upper and upper at bin and bin + 1
// of its low end, and their negatives at its high end. They are whole numbers, so they cancel exactly.
typedef struct { intv bin[2], upper[2], slope; } Steps;

INLINE Steps ramp_steps(const Ramp *ramp, int lines) {
    Steps steps;
    steps.slope = to_int(ramp->slope + (real)0.5);
    const realv place[2] = {ramp->low, ramp->high};
    for (int end = 0; end < 2; ++end) {
        realv p = place[end] > 0 ? place[end] : (realv)(0);
        p = p < lines ? p : (realv)(lines);
        steps.bin[end] = to_int(p);
        steps.upper[end] = to_int((p - to_real(steps.bin[end])) * to_real(steps.slope) + (real)0.5);
    }
    return steps;
}
