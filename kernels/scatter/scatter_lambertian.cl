// The Lambertian model: BSDF [1/sr] is the same in all directions. numbers: the BSDF.
#include "scattered.cl"

INLINE real bsdf_lambertian(__constant Lobe *lobe, real d2) { return lobe->numbers[0]; }

SCATTERS(lambertian)
