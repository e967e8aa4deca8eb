// Codes of paths of up to 42 events, for long chains of elements: eight words.
#include "simd_*.cl"

#define PATH_WORDS 8
