// Tallies of a non-sequential trace: rays and weights where they end, and the detector's images by path. Unit: mm.
#include "carry_*.cl"
#include "ray_stack_*.cl"
#include "sum64.cl"

// The sums, in order: rays by how they end; rays absorbed at each element; weight that stays at each element, escapes,
// or ends at the bounce limit; rays and flux of each path. PATH_SPLIT counts rays that split from others.
enum { PATH_DETECTED, PATH_ESCAPED, PATH_BOUNCE_LIMIT, PATH_FAILED, PATH_SPLIT, PATH_ABSORBED };
#define MAX_SUMS 200   // PATH_ABSORBED + 2 x 20 elements + 2 + 2 x 64 paths

// Fixed-point scale of weights that stay: a sum holds 2^43 rays of weight 1.
#define STAYING_ONE 0x1p20f
#define STAYING_MOST 2000.0f   // the largest weight that, times STAYING_ONE, fits an int

// A work-item's view of the trace. In paths: scale turns a path's weights into whole numbers below 2^31, so that a sum
// holds 2^33 rays; kind is its highest event class, an EVENT_*; class_scale is the scale of that class's images.
typedef struct {
    __constant Scene *scene;
    __global const real *tables;  // of the mirror
    __constant Element *elements;
    __constant Scatter *scatter;
    const Launch *launch;
    __global const Path *paths;
    __global uint *sums;          // 64-bit
    __global uint *images;        // 64-bit: [classes][screen columns and rows][detector pixels]
    __global uint *found;         // number of entries, then (path's words, weight's bits) of detected rays
    const PathJob *job;
    RayStack *stack;
    ulong *own;                   // the work-item's own sums, added to sums at its end
    int column, row;              // the screen pixel
} Trace;

INLINE void count_rays(const Trace *trace, int fate, uint count) { trace->own[fate] += count; }

// Adds weight that stays. place: an element's number, or element_count (escaped), element_count + 1 (bounce limit).
INLINE void count_weight_of(const Trace *trace, int place, real weight) {
    trace->own[PATH_ABSORBED + trace->job->element_count + place] += (ulong)((float)weight * STAYING_ONE + 0.5f);
}
INLINE void count_weight(const Trace *trace, int place, maskv stays, realv weight) {
    if (!any_lane(stays)) return;
    if (any_lane(stays & (weight > STAYING_MOST))) {
        for (ulong lanes = mask_word(stays); lanes != 0; lanes &= lanes - 1)
            count_weight_of(trace, place, ((const real *)&weight)[lowest_lane(lanes)]);
        return;
    }
    const realv counted = stays ? weight * STAYING_ONE + (real)0.5 : (realv)(0);
    trace->own[PATH_ABSORBED + trace->job->element_count + place] += sum_lanes(to_int(counted));
}

// Adds the weight of `count` rays that stay, each of the same weight; the same sum as ray by ray.
INLINE void count_equal_weights(const Trace *trace, int place, uint count, real weight) {
    const ulong one = weight > STAYING_MOST ? (ulong)((float)weight * STAYING_ONE + 0.5f)
                                            : (ulong)(weight * STAYING_ONE + (real)0.5);
    trace->own[PATH_ABSORBED + trace->job->element_count + place] += count * one;
}

INLINE bool is_path(__global const Path *path, const uint *code) {
    bool same = true;
    for (int w = 0; w < PATH_WORDS; ++w) same = same && path->word[w] == code[w];
    return same;
}

// Records one detected ray of a path's code at (u, v) in the detector's frame. Its z runs along the light, so the image
// is upside down.
INLINE void detect(const Trace *trace, real u, real v, real weight, const uint *code) {
    const Launch *launch = trace->launch;
    __constant Scene *scene = trace->scene;
    const int columns = scene->detector_columns, rows = scene->detector_rows;
    const real column = (real)0.5 * columns - u * scene->inverse_detector_pitch_x;
    const real row = (real)0.5 * rows - v * scene->inverse_detector_pitch_y;
    if (!(column >= 0 && column < columns && row >= 0 && row < rows)) return count_rays(trace, PATH_FAILED, 1);
    count_rays(trace, PATH_DETECTED, 1);
    if (trace->job->found_size > 0) {
        const uint entry = atomic_inc(trace->found);
        if (entry < (uint)trace->job->found_size) {
            __global uint *into = trace->found + 1 + (PATH_WORDS + 1) * entry;
            for (int w = 0; w < PATH_WORDS; ++w) into[w] = code[w];
            into[PATH_WORDS] = as_uint((float)weight);
        }
        return;
    }
    int p = 0;
    while (p < trace->job->path_count - 1 && !is_path(&trace->paths[p], code)) ++p;
    const Path path = trace->paths[p];   // the last entry stands for all other paths
    const int base = PATH_ABSORBED + 2 * trace->job->element_count + 2 + 2 * p;
    trace->own[base] += 1;
    trace->own[base + 1] += (ulong)((float)weight * path.scale + 0.5f);
    const ulong amount = (ulong)((float)weight * path.class_scale + 0.5f);
    const size_t pixel = (int)row * columns + (int)column, lines = launch->screen_columns + launch->screen_rows;
    const size_t pixels = launch->detector_pixels, first = path.kind * lines;
    sum64_add(trace->images, (first + trace->column) * pixels + pixel, amount);
    sum64_add(trace->images, (first + launch->screen_columns + trace->row) * pixels + pixel, amount);
}

// Writes the rays back in world axes, from the origin of the element's own group, with the event added to their paths.
INLINE void interaction_end(__constant Element *element, Rays *rays, int v, int number, maskv meets, realv bound,
                            realv step, const Interaction *at) {
    __constant real *o = element->origin;
    const vec3v p = to_world(element, at->point), d = to_world(element, at->goes);
    rays->x[v] = meets ? p.x + o[0] : rays->x[v];
    rays->y[v] = meets ? p.y + o[1] : rays->y[v];
    rays->z[v] = meets ? p.z + o[2] : rays->z[v];
    rays->dx[v] = meets ? d.x : rays->dx[v];
    rays->dy[v] = meets ? d.y : rays->dy[v];
    rays->dz[v] = meets ? d.z : rays->dz[v];
    rays->l1_norm[v] = l1_norm_of(rays->x[v], rays->y[v], rays->z[v]);
    rays->weight[v] = meets ? at->arriving * at->weight : rays->weight[v];
    light_leave(element, rays, v, meets, at);
    PathCode path = path_of(rays, v);
    path_push(&path, as_uintv(at->event + (EVENT_KINDS * number + 1)));
    const intv here = to_int(meets);
    for (int w = 0; w < PATH_WORDS; ++w) rays->path[w][v] = here != 0 ? path.word[w] : rays->path[w][v];
    const intv touches = here & to_int(step <= bound);
    rays->before[v] = here != 0 ? (touches != 0 ? rays->last[v] : (intv)(-1)) : rays->before[v];
    rays->last[v] = here != 0 ? (intv)(number) : rays->last[v];
    rays->group[v] = here != 0 ? (intv)(element->group) : rays->group[v];
}

// The scatter model `none`: all light stays specular, and no ray splits.
#define none_left(trace, number, at) ((realv)(1))
#define none_split(trace, rays, v, number, meets, at)

// For each kind of element: leave_* writes back the rays that continue; tally_* counts what stays there and returns the
// rays that end. left: share of the light that does not scatter.
#define leave_mirror interaction_end
#define leave_lens interaction_end
#define leave_diffuser interaction_end
#define leave_detector interaction_end
#define leave_absorber(...)   // nothing leaves an absorber
INLINE maskv tally_absorbed(const Trace *trace, int number, maskv meets, const Interaction *at, realv staying) {
    const maskv ended = meets & at->ends;
    count_rays(trace, PATH_ABSORBED + number, lanes_in(ended));
    count_weight(trace, number, meets & (at->absorbed > 0), at->arriving * at->absorbed * staying);
    return ended;
}
#define tally_mirror(trace, rays, v, number, meets, at, left) tally_absorbed(trace, number, meets, at, (realv)(1))
#define tally_lens tally_mirror
#define tally_absorber tally_mirror
#define tally_diffuser(trace, rays, v, number, meets, at, left) tally_absorbed(trace, number, meets, at, left)

INLINE maskv tally_detector(const Trace *trace, const Rays *rays, int v, int number, maskv meets,
                            const Interaction *at, realv left) {
    const maskv front = meets & (dot3(at->along, at->normal) > 0), back = meets & !front;
    count_rays(trace, PATH_ABSORBED + number, lanes_in(back));
    count_weight(trace, number, back, at->arriving);
    for (ulong lanes = mask_word(front); lanes != 0; lanes &= lanes - 1) {
        const int k = lowest_lane(lanes);
        uint code[PATH_WORDS];
        for (int w = 0; w < PATH_WORDS; ++w) code[w] = ((const uint *)&rays->path[w][v])[k];
        detect(trace, ((const real *)&at->point.x)[k], ((const real *)&at->point.y)[k],
               ((const real *)&rays->weight[v])[k], code);
    }
    return meets;
}
