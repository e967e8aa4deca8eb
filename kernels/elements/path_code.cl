// Codes of paths: six bits per event, the latest in the lowest bits of the first word; 0 stands for no event.
#include "path_code_*.cl"

#define PATH_BITS 6

typedef struct { uintv word[PATH_WORDS]; } PathCode;

// Event and element number form one digit of the path.
INLINE void path_push(PathCode *path, uintv digit) {
    for (int w = PATH_WORDS - 1; w > 0; --w)
        path->word[w] = path->word[w] << PATH_BITS | path->word[w - 1] >> (32 - PATH_BITS);
    path->word[0] = path->word[0] << PATH_BITS | digit;
}

// Odd factors of the words in a hash of the code.
INLINE uint path_factor(int word) { return word == 1 ? 0x85EBCA77u : 0x9E3779B1u * (2 * (uint)word + 1); }

// A random word for one use at this point of a ray's path. It is a hash of use, path and key (with the finalizer of
// MurmurHash3), so it depends only on seed, replicate, source, ray, path and use.
INLINE uintv path_word(uintv key, const PathCode *path, uint use) {
    uintv word = key + use * 0xC2B2AE3Du;
    for (int w = 0; w < PATH_WORDS; ++w) word += path->word[w] * path_factor(w);
    word = (word ^ word >> 16) * 0x85ebca6bu;
    word = (word ^ word >> 13) * 0xc2b2ae35u;
    return word ^ word >> 16;
}
