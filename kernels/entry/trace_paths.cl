// Non-sequential estimator: rays leave the screen, aimed at the mirror or at more, and follow elements in the order
// they meet them until they end. Light that ends on the detector is recorded by path and by class of path. Frame: the
// world. Unit: mm.
//
// The host writes ELEMENTS(DO), the scene's list of elements: DO(shape, kind, model, number) for each. shape: plane,
// quadric or deviated; kind: the name of an interact_* file; model: the name of a scatter_* file, or none.
#include "frame_*.cl"
#include "sieve_*.cl"

// Puts a batch of rays that leave the screen into the list. Positions count from the screen group's origin: small
// numbers. cones: of cones_begin.
INLINE void emit(const Trace *trace, __global const Emitter *emitter, const Batch *batch, uint cones, Rays *rays) {
    __constant Scene *scene = trace->scene;
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const Leave aim = cones_leave(trace->job, emitter, batch_words(batch, FORWARD_AIM_RADIUS, v),
                                      batch_words(batch, FORWARD_AIM_ANGLE, v), cones, batch->first, v);
        const realv x = emitter->x + scene->screen_pitch_x * uniform_centred(batch_words(batch, FORWARD_PIXEL_X, v));
        const realv y = emitter->y + scene->screen_pitch_y * uniform_centred(batch_words(batch, FORWARD_PIXEL_Y, v));
        const vec3v at = frame_across(&scene->screen, x, y);
        const vec3v along = frame_along(&scene->screen, aim.l, aim.m, aim.n);
        rays->x[v] = at.x, rays->y[v] = at.y, rays->z[v] = at.z;
        rays->dx[v] = along.x, rays->dy[v] = along.y, rays->dz[v] = along.z;
        rays->l1_norm[v] = l1_norm_of(rays->x[v], rays->y[v], rays->z[v]);
        rays->weight[v] = aim.weight;
        light_emit(rays, v);
        for (int w = 0; w < PATH_WORDS; ++w) rays->path[w][v] = (uintv)(0);
        rays->key[v] = ((const uintv *)batch->keys)[v];
        rays->group[v] = (intv)(trace->job->screen_group);
        rays->last[v] = (intv)(trace->job->screen_element);
        rays->before[v] = (intv)(-1);
        rays->bounces[v] = (intv)(0);
    }
}

// An element's turn with vector v: the lanes that meet it, their rays in its frame, the rounding bound of their steps,
// and the interaction.
typedef struct {
    __constant Element *element;
    maskv meets;
    LocalRay ray;
    realv bound;
    Interaction at;
} Visit;

INLINE Interaction interaction_begin(const Trace *trace, const Rays *rays, int v, const LocalRay *ray, int number) {
    Interaction at;
    at.along = at.goes = ray->along;
    at.arriving = rays->weight[v];
    at.weight = (realv)(1);
    at.absorbed = at.split = (realv)(0);
    at.event = (intv)(EVENT_NOMINAL);
    at.room = (intv)(stack_room(trace->stack));
    at.ends = to_mask(at.event != at.event);
    const PathCode path = path_of(rays, v);
    at.draw = path_word(rays->key[v], &path, number);
    return at;
}

// The nearest element ahead of each ray of a list, and the step to it. which is NONE for a ray that escapes and ENDED
// for a ray that ended at an element.
typedef struct { realv step[BLOCK_VECTORS]; intv which[BLOCK_VECTORS]; } Nearest;
#define NONE (-1)
#define ENDED (-2)

// For finding the nearest element, the outer loop is over elements and the inner one over rays: in short loops a
// processor sees enough rays at a time. Interactions are taken vector by vector instead; with element loops they ran at
// two thirds of that rate.
#define MEET(shape, kind, model, number) \
    if (may >> number & 1u) \
        for (int v = 0; v < vectors; ++v) \
            meet_##shape(&trace->elements[number], rays, v, number, &nearest->step[v], &nearest->which[v]);

INLINE Visit visit_begin(const Trace *trace, const Rays *rays, int v, int number, maskv meets) {
    Visit visit;
    visit.element = &trace->elements[number];
    visit.meets = meets;
    const Offset offset = group_offset(visit.element, rays->group[v]);
    visit.ray = element_ray(visit.element, rays, v, &offset);
    visit.bound = element_bound(rays, v, &offset);
    visit.at = interaction_begin(trace, rays, v, &visit.ray, number);
    visit.at.light = light_arrive(visit.element, rays, v);
    return visit;
}

// Whether any ray of a vector meets the element.
INLINE bool is_met(uint may, int number, intv which) {
    return (may >> number & 1u) && any_lane(to_mask(which == number));
}

// left: share of the light that does not scatter.
INLINE void keep_specular(Rays *rays, int v, maskv meets, realv left) {
    rays->weight[v] = meets ? rays->weight[v] * left : rays->weight[v];
}

#define INTERACT(shape, kind, model, number)                                                                   \
    if (is_met(may, number, which)) {                                                                          \
        Visit visit = visit_begin(trace, rays, v, number, to_mask(which == (number)));                         \
        visit.at.point = shape##_point(trace->scene, trace->tables, visit.element, &visit.ray, step);          \
        visit.at.normal = shape##_normal(trace->scene, trace->tables, visit.element, visit.at.point);          \
        interact_##kind(visit.element, &visit.at);                                                             \
        const realv left = model##_left(trace, number, &visit.at);                                             \
        leave_##kind(visit.element, rays, v, number, visit.meets, visit.bound, step, &visit.at);               \
        model##_split(trace, rays, v, number, visit.meets, &visit.at);                                         \
        keep_specular(rays, v, visit.meets, left);                                                             \
        const maskv ended = tally_##kind(trace, rays, v, number, visit.meets, &visit.at, left);                \
        after = to_int(ended) != 0 ? (intv)(ENDED) : after;                                                    \
    }

// may: one bit for each element that the rays may meet in this step.
INLINE void find_nearest(const Trace *trace, const Rays *rays, int count, uint may, Nearest *nearest) {
    const int vectors = (count + WIDTH - 1) / WIDTH;
    for (int v = 0; v < vectors; ++v) {
        nearest->step[v] = (realv)(INFINITY);
        nearest->which[v] = (intv)(NONE);
    }
    ELEMENTS(MEET)
    const intv beyond = as_intv(lane_index()) + (vectors - 1) * WIDTH;   // past the list's end
    nearest->which[vectors - 1] = beyond < count ? nearest->which[vectors - 1] : (intv)(ENDED);
}

// Takes the rays of vector v through their elements. Returns those that continue, as mask_word gives them; counts the
// rest.
INLINE ulong step_rays(const Trace *trace, Rays *rays, int v, uint may, realv step, intv which) {
    intv after = which;
    ELEMENTS(INTERACT)
    rays->bounces[v] = rays->bounces[v] + 1;
    const maskv goes = to_mask(after >= 0), tired = goes & to_mask(rays->bounces[v] >= trace->job->bounce_limit);
    const maskv escaped = to_mask(which == NONE);
    count_rays(trace, PATH_ESCAPED, lanes_in(escaped));
    count_rays(trace, PATH_BOUNCE_LIMIT, lanes_in(tired));
    count_weight(trace, trace->job->element_count, escaped, rays->weight[v]);
    count_weight(trace, trace->job->element_count + 1, tired, rays->weight[v]);
    return mask_word(goes & !tired);
}

// Traces all rays of the list to their ends. After each step the list closes up.
INLINE void trace_rays(const Trace *trace, Rays *rays, int count) {
    Nearest nearest;
    const int known = sizeof(trace->job->may) / sizeof(trace->job->may[0]);
    int step = 0;
    while ((count = stack_pop(trace->stack, rays, count)) > 0) {
        int left = 0;
        const uint may = step < known ? trace->job->may[step++] : ~0u;
        find_nearest(trace, rays, count, may, &nearest);
        for (int v = 0; v * WIDTH < count; ++v) {
            const ulong alive = step_rays(trace, rays, v, may, nearest.step[v], nearest.which[v]);
            if (alive == ALL_LANES && left == v * WIDTH) left += WIDTH;   // already in place
            else   // in ascending order, so no ray is overwritten before it is copied
                for (int part = 0; part < LANE_PARTS; ++part)
                    for (ulong lanes = alive >> part & LANE_PART; lanes != 0; lanes &= lanes - 1)
                        ray_copy(rays, left++, rays, v * WIDTH + 8 * part + lowest_lane(lanes));
        }
        count = left;
    }
}

// Parameters: see Trace. Grid: (screen pixels of this launch, runs of its rays).
// Assumes: sums, images and the first word of found were zeroed before the replicate's first launch.
__kernel void trace_paths(__constant Scene *scene, const Launch launch, __global const real *tables,
                          __global const Emitter *emitters, __constant Element *elements, __constant Scatter *scatter,
                          __global const Path *paths, __global uint *sums, __global uint *images, __global uint *found,
                          const PathJob job) {
    const WorkItem item = work_item(&launch);
    const uint source = item.source;
    const int sums_size = PATH_ABSORBED + 2 * job.element_count + 2 + 2 * job.path_count;
    ulong own[MAX_SUMS];
    for (int k = 0; k < sums_size; ++k) own[k] = 0;
    RayStack stack;
    stack_begin(&stack);
    const Trace trace = {scene, tables, elements, scatter, &launch, paths, sums, images, found, &job, &stack, own,
                         source % launch.screen_columns, source / launch.screen_columns};
    const uint cones = cones_begin(&launch, source);
    Sieve sieve;
    sieve_begin(&sieve, &trace, &item, &emitters[source]);
    Batch batch;
    Rays rays;
    while (sieve_fill(&sieve, &trace, &batch)) {
        emit(&trace, &emitters[source], &batch, cones, &rays);
        trace_rays(&trace, &rays, batch.count);
    }
    sieve_end(&sieve, &trace);
    own[PATH_FAILED] += stack_lost(&stack);
    for (int k = 0; k < sums_size; ++k)
        if (own[k] != 0) sum64_add(sums, k, own[k]);
}
