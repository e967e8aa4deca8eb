// Random words that randomise the low-discrepancy points of a source: one per dimension, independent between sources,
// replicates and runs of 2^32 rays, and between the parts of a run that a sampler randomises apart.
#include "words.cl"
#include "philox.cl"

INLINE void sampler_seeds(const Launch *launch, uint source, uint run, uint part,
                          uint seeds[DIMENSIONS]) {
    // the second counter word is nearly all ones: no ray of sampler_philox.cl, which would need number 2^64 - 2^33, uses
    // it
    const Philox counter = {{(wordv)(run), (wordv)(0xffffffffu - part), (wordv)(source), (wordv)(launch->replicate)}};
    const Philox out = philox4x32_10(counter, launch->seed_low, launch->seed_high);
    for (int d = 0; d < DIMENSIONS; ++d) seeds[d] = ((const uint *)&out.word[d])[0];
}
