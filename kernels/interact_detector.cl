// The detector: light from the front ends in its pixels (trace_paths.cl records it), its back is black.
#include "interaction.cl"

INLINE void interact_detector(__constant Element *element, Interaction *at) { at->ends = to_mask(at->event == at->event); }
