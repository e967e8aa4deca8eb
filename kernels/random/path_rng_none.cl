// No random words for ray paths: for scenes where nothing on a path is random.
#include "simd_*.cl"

INLINE wordv path_key(const Launch *launch, uint source, wordv low, wordv high) { return (wordv)(0); }
