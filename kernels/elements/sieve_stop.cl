// Rays that surely end at the camera's stop, or beside everything, are counted here; only the others are followed from
// element to element. For scenes where light goes from the screen to the mirror and on to the plane of the stop, and
// nowhere else (irtscots_cl/optics/elements/stop_sieve.py): there nearly all rays end at the stop.
// Frames and stages as in path_forward.cl. Unit: mm.
#include "work_item.cl"
#include "batch.cl"
#include "path_forward.cl"

// words ... follow: of a block of rays; follow: the lanes of each vector that must be followed and are not yet in a
// batch, as mask_word gives them, from vector `at` on. next: the number of the block's successor's first ray.
// missed, stopped, escaped: numbers of rays that miss the mirror; end at the stop; leave the mirror and meet nothing.
typedef struct {
    Words words;
    Direction aims[BLOCK_VECTORS];
    Line lines[BLOCK_VECTORS];
    Meeting meetings[BLOCK_VECTORS];
    ulong follow[BLOCK_VECTORS];
    int at;
    Sampler sampler;
    uint source;
    ulong next, end;
    Emitter emitter;
    intv missed, stopped, escaped;
} Sieve;

INLINE void sieve_begin(Sieve *sieve, const Trace *trace, const WorkItem *item, __global const Emitter *emitter) {
    sampler_begin(&sieve->sampler, trace->launch, item->source);
    sieve->source = item->source;
    sieve->next = item->begin;
    sieve->end = item->end;
    sieve->emitter = *emitter;
    sieve->at = BLOCK_VECTORS;
    sieve->missed = sieve->stopped = sieve->escaped = (intv)(0);
}

// Counts the rays of vector v whose end is known, of the lanes that are rays. The others are to be followed.
INLINE void sieve_vector(Sieve *sieve, const Trace *trace, int v, maskv rays) {
    const StopSieve *limits = &trace->job->sieve;
    __constant Scene *scene = trace->scene;
    const Meeting *met = &sieve->meetings[v];
    realv a, b, slope_a, slope_b;
    const maskv ahead = reflected_arrive(scene, &scene->camera, &sieve->lines[v], met, &a, &b, &slope_a, &slope_b);
    const realv mirror2 = met->point.x * met->point.x + met->point.y * met->point.y, stop2 = a * a + b * b;
    const maskv on = rays & met->on_mirror & (mirror2 >= limits->mirror_least2) & (mirror2 <= limits->mirror_most2);
    const maskv missed = rays & (!met->on_mirror | (mirror2 < limits->hole2) | (mirror2 > limits->rim2));
    const maskv stopped = on & ahead & (stop2 >= limits->stop_least2) & (stop2 <= limits->stop_most2);
    const maskv beside = (stop2 > limits->beside2) & (slope_a * slope_a + slope_b * slope_b < limits->slope2);
    const maskv escaped = on & (!ahead | beside);
    sieve->missed = count_mask(sieve->missed, missed);
    sieve->stopped = count_mask(sieve->stopped, stopped);
    sieve->escaped = count_mask(sieve->escaped, escaped);
    sieve->follow[v] = mask_word(rays & !(missed | stopped | escaped));
}

// Sieves the next block, in short passes as trace_forward.cl does.
INLINE void sieve_block(Sieve *sieve, const Trace *trace) {
    __constant Scene *scene = trace->scene;
    const uint count = (uint)min(sieve->end - sieve->next, (ulong)(BLOCK));
    sampler_block(&sieve->sampler, sieve->next, &sieve->words);
    for (int v = 0; v < BLOCK_VECTORS; ++v) sieve->aims[v] = forward_aim(&sieve->emitter, &sieve->words, v);
    for (int v = 0; v < BLOCK_VECTORS; ++v)
        sieve->lines[v] = forward_emit(scene, &sieve->emitter, &sieve->aims[v], &sieve->words, v);
    for (int v = 0; v < BLOCK_VECTORS; ++v) {
        const Line *line = &sieve->lines[v];
        Meeting *met = &sieve->meetings[v];
        met->on_mirror = surface_meet(&scene->mirror, line->x0, line->y0, line->p, line->q, &met->point);
    }
    for (int v = 0; v < BLOCK_VECTORS; ++v) sieve_vector(sieve, trace, v, to_mask(lane_index() + v * WIDTH < count));
    sieve->next += BLOCK;
    sieve->at = 0;
}

// Puts a ray of the block, in this lane of vector v, at the end of the batch; high: where the upper halves of the rays'
// numbers wait, as the lower ones do where the keys will be.
INLINE void batch_add(Batch *batch, const Sieve *sieve, wordv *high, int v, int lane) {
    const ulong ray = sieve->next - BLOCK + v * WIDTH + lane;
    for (int d = 0; d < DIMENSIONS; ++d) {
        const uintv words = ray_words(&sieve->words, d, v);
        ((uint *)batch->words[d])[batch->count] = ((const uint *)&words)[lane];
    }
    ((uint *)batch->keys)[batch->count] = (uint)ray;
    ((uint *)high)[batch->count] = (uint)(ray >> 32);
    ++batch->count;
}

// The places behind the last ray repeat it: whole blocks are emitted, and nothing is read that nobody set.
INLINE void batch_end(Batch *batch, wordv *high) {
    for (int k = batch->count, last = k - 1; k < BLOCK; ++k) {
        for (int d = 0; d < DIMENSIONS; ++d) ((uint *)batch->words[d])[k] = ((const uint *)batch->words[d])[last];
        ((uint *)batch->keys)[k] = ((const uint *)batch->keys)[last];
        ((uint *)high)[k] = ((const uint *)high)[last];
    }
}

// Fills the batch with the next rays of the work-item that must be followed. Returns false if there are none left.
INLINE bool sieve_fill(Sieve *sieve, const Trace *trace, Batch *batch) {
    wordv high[BLOCK / WORD_LANES];
    batch->count = 0;
    batch->first = 0;
    while (batch->count < BLOCK) {
        if (sieve->at == BLOCK_VECTORS) {
            if (sieve->next >= sieve->end) break;
            sieve_block(sieve, trace);
        }
        ulong lanes = sieve->follow[sieve->at];
        for (; lanes != 0 && batch->count < BLOCK; lanes &= lanes - 1)
            batch_add(batch, sieve, high, sieve->at, lowest_lane(lanes));
        sieve->follow[sieve->at] = lanes;
        if (lanes == 0) ++sieve->at;
    }
    if (batch->count == 0) return false;
    batch_end(batch, high);
    for (int v = 0; v * WORD_LANES < batch->count; ++v)
        batch->keys[v] = path_key(trace->launch, sieve->source, batch->keys[v], high[v]);
    return true;
}

// Counts the rays that were not followed. All of a source's rays have the same weight.
INLINE void sieve_end(const Sieve *sieve, const Trace *trace) {
    const PathJob *job = trace->job;
    const uint missed = count_lanes(sieve->missed), stopped = count_lanes(sieve->stopped);
    const uint escaped = count_lanes(sieve->escaped);
    const real weight = cones_weight(job, &sieve->emitter), share = trace->elements[0].reflectance;
    count_rays(trace, PATH_ESCAPED, missed + escaped);
    count_rays(trace, PATH_ABSORBED + job->sieve.stop, stopped);
    count_equal_weights(trace, job->element_count, missed, weight);
    count_equal_weights(trace, job->element_count, escaped, weight * share);
    count_equal_weights(trace, job->sieve.stop, stopped, weight * share);
    count_equal_weights(trace, 0, stopped + escaped, weight * (1 - share));
}
