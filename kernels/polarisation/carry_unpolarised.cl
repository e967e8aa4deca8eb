// What becomes of the polarisation of rays where nothing refracts: nothing, for rays without it.
#include "interaction.cl"

INLINE void light_emit(Rays *rays, int v) {}
INLINE Stokes light_arrive(__constant Element *element, const Rays *rays, int v) { return (Stokes){0}; }
INLINE void light_leave(__constant Element *element, Rays *rays, int v, maskv meets, const Interaction *at) {}
INLINE void light_mirror(Interaction *at) {}
INLINE void light_turn(Interaction *at) {}
INLINE StokesOne light_natural(void) { return (StokesOne){0}; }
INLINE StokesOne light_reflected(__constant Element *element, const Interaction *at, int k) { return (StokesOne){0}; }
INLINE void light_put(Rays *rays, int place, StokesOne light) {}
