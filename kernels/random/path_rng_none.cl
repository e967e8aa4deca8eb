// No random words for ray paths: for scenes where nothing on a path is random.
#include "keys.cl"

INLINE void path_keys(const Launch *launch, uint source, ulong first, Keys *keys) {
    for (int v = 0; v < BLOCK / WORD_LANES; ++v) keys->of[v] = (wordv)(0);
}
