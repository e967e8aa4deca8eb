// No accumulation: for measuring what the others cost. Rays are traced to the end, forward ones counted by fate; what their
// bins would be is kept alive by a sum, so that the compiler cannot leave the tracing out.
#include "window.cl"

INLINE void hits_begin(Hits *hits) { hits->tile[0] = 0; }
INLINE void hits_add(Hits *hits, int pixel) { hits->tile[0] += pixel; }
INLINE void hits_end(Hits *hits) {}

INLINE void light_begin(Light *light) { light->tile[0] = 0; }
INLINE void light_add(Light *light, int bin, long amount) { light->tile[0] += bin + amount; }
INLINE void light_end(Light *light) {}
