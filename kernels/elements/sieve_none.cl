// Every ray is followed: for scenes where a ray's end is not known before.
#include "work_item.cl"
#include "batch.cl"

typedef struct { Sampler sampler; uint source; ulong next, end; } Sieve;

INLINE void sieve_begin(Sieve *sieve, const Trace *trace, const WorkItem *item, __global const Emitter *emitter) {
    sampler_begin(&sieve->sampler, trace->launch, item->source);
    sieve->source = item->source;
    sieve->next = item->begin;
    sieve->end = item->end;
}

// Fills the batch with the next rays of the work-item. Returns false if there are none left.
INLINE bool sieve_fill(Sieve *sieve, const Trace *trace, Batch *batch) {
    if (sieve->next >= sieve->end) return false;
    Words words;
    sampler_block(&sieve->sampler, sieve->next, &words);
    for (int d = 0; d < DIMENSIONS; ++d)
        for (int v = 0; v < BLOCK_VECTORS; ++v) ((uintv *)batch->words[d])[v] = ray_words(&words, d, v);
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) {
        const ulong ray = sieve->next + v * WORD_LANES;
        const wordv low = (uint)ray + word_index();
        const wordv high = (uint)(ray >> 32) + (low < (uint)ray ? (wordv)(1) : (wordv)(0));
        batch->keys[v] = path_key(trace->launch, sieve->source, low, high);
    }
    batch->first = sieve->next;
    batch->count = (int)min(sieve->end - sieve->next, (ulong)(BLOCK));
    sieve->next += BLOCK;
    return true;
}

INLINE void sieve_end(const Sieve *sieve, const Trace *trace) {}
