// Random words of the limit kernels: Philox4x32-10, one block for a ray's four words.
#include "philox.cl"

INLINE void limit_words(uint first, uint stream, uint seed, wordv word[4]) {
    const Philox counter = {{word_index() + first, (wordv)(stream), (wordv)(0), (wordv)(0)}};
    const Philox out = philox4x32_10(counter, seed, 1);
    for (int d = 0; d < 4; ++d) word[d] = out.word[d];
}
