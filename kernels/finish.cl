// What becomes of light on its way: rays counted where they end, and the detector's images by path.
#include "interaction.cl"
#include "spawn_*.cl"
#include "sum64.cl"

// Ends of rays, then one for each element; PATH_PARTED counts those that were not launched but parted from others.
enum { PATH_DETECTED, PATH_ESCAPED, PATH_BOUNCE_LIMIT, PATH_FAILED, PATH_PARTED, PATH_ABSORBED };
#define MAX_SUMS 192   // PATH_ABSORBED + 20 elements + 2 x 64 paths

// Path, a path that is kept: scale makes weights whole numbers below 2^31, so that 2^33 rays fit a sum; kind: the
// strangest of its events, an EVENT_*; class_scale: the same for the images of all paths of that kind.
typedef struct {
    __constant Scene *scene;
    __constant Element *elements;
    const Launch *launch;
    __global const Path *paths;
    __global uint *sums;          // 64-bit: [fates and elements] rays, then for each path its rays and its flux
    __global uint *images;        // 64-bit: [classes][screen columns and rows][detector pixels]
    __global uint *found;         // number of entries, then (low, high, weight's bits) of detected rays
    const PathJob *job;
    Spawned *spawned;
    ulong *own;                   // the work-item's part of sums, added to them at its end
    int column, row;              // the screen pixel
} Trace;

INLINE void count_rays(const Trace *trace, int fate, uint count) { trace->own[fate] += count; }

// Keeps one detected ray at (u, v) of the detector's frame, whose z runs along the light: the image is upside down.
INLINE void detect(const Trace *trace, real u, real v, real weight, uint low, uint high) {
    const Launch *launch = trace->launch;
    __constant Scene *scene = trace->scene;
    const int columns = scene->detector_columns, rows = scene->detector_rows;
    const real column = (real)0.5 * columns - u * scene->inverse_detector_pitch;
    const real row = (real)0.5 * rows - v * scene->inverse_detector_pitch;
    if (!(column >= 0 && column < columns && row >= 0 && row < rows)) return count_rays(trace, PATH_FAILED, 1);
    count_rays(trace, PATH_DETECTED, 1);
    if (trace->job->found_size > 0) {
        const uint entry = atomic_inc(trace->found);
        if (entry < (uint)trace->job->found_size) {
            trace->found[3 * entry + 1] = low;
            trace->found[3 * entry + 2] = high;
            trace->found[3 * entry + 3] = as_uint((float)weight);
        }
        return;
    }
    int p = 0;
    while (p < trace->job->path_count - 1 && (trace->paths[p].low != low || trace->paths[p].high != high)) ++p;
    const Path path = trace->paths[p];   // the last one stands for all others
    const int base = PATH_ABSORBED + trace->job->element_count + 2 * p;
    trace->own[base] += 1;
    trace->own[base + 1] += (ulong)((float)weight * path.scale + 0.5f);
    const ulong amount = (ulong)((float)weight * path.class_scale + 0.5f);
    const size_t pixel = (int)row * columns + (int)column, lines = launch->screen_columns + launch->screen_rows;
    const size_t pixels = launch->detector_pixels, first = path.kind * lines;
    sum64_add(trace->images, (first + trace->column) * pixels + pixel, amount);
    sum64_add(trace->images, (first + launch->screen_columns + trace->row) * pixels + pixel, amount);
}

// What becomes of rays at an element, where `meets`: those that end are counted as absorbed by it, or detected. Returns
// which of them end.
#define FINISH_ABSORBED(kind)                                                                                \
    INLINE maskv finish_##kind(const Trace *trace, const Rays *rays, int v, int number, maskv meets,         \
                               const Interaction *at) {                                                      \
        const maskv ended = meets & at->ends;                                                                \
        count_rays(trace, PATH_ABSORBED + number, lanes_in(ended));                                \
        return ended;                                                                                        \
    }
#define leave_mirror interaction_end
#define leave_lens interaction_end
#define leave_refractor interaction_end
#define leave_detector interaction_end
#define leave_scattering interaction_end
#define leave_absorber(...)   // nothing leaves it
FINISH_ABSORBED(mirror)
FINISH_ABSORBED(absorber)
FINISH_ABSORBED(lens)
FINISH_ABSORBED(refractor)

INLINE maskv finish_detector(const Trace *trace, const Rays *rays, int v, int number, maskv meets, const Interaction *at) {
    const maskv front = meets & (dot3(at->along, at->normal) > 0), back = meets & !front;
    count_rays(trace, PATH_ABSORBED + number, lanes_in(back));
    for (ulong lanes = mask_word(front); lanes != 0; lanes &= lanes - 1) {
        const int k = lowest_lane(lanes);
        detect(trace, ((const real *)&at->point.x)[k], ((const real *)&at->point.y)[k], ((const real *)&rays->weight[v])[k],
               ((const uint *)&rays->path_low[v])[k], ((const uint *)&rays->path_high[v])[k]);
    }
    return meets;
}
