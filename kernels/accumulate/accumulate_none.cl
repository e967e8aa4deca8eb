// No accumulation: for measuring the cost of the others. Rays are traced to the end, and forward rays are counted by
// fate. A sum over their bins keeps the compiler from removing the tracing.
#include "window.cl"

INLINE void hits_begin(Hits *hits) { hits->tile[0] = 0; }
INLINE void hits_add(Hits *hits, int pixel) { hits->tile[0] += pixel; }
INLINE void hits_end(Hits *hits) {}

INLINE void light_begin(Light *light) { light->tile[0] = 0; }
INLINE void light_add(Light *light, int bin, long amount) { light->tile[0] += bin + amount; }
INLINE void light_differences(Light *light, int lines, int first) {}
INLINE void light_end(Light *light) {}
