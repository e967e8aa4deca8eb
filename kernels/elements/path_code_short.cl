// Codes of paths of up to ten events: two words.
#include "simd_*.cl"

#define PATH_WORDS 2
