// No random words for ray paths: for scenes where nothing on a path is random.
#include "words.cl"

INLINE void path_keys(const Launch *launch, uint source, ulong first, Words *keys) {
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) keys->of[0][v] = (wordv)(0);
}
