// Lambertian scatterers: the same BSDF [1/sr] everywhere. numbers: it.
#include "scattered.cl"

INLINE real bsdf_lambertian(__constant Lobe *lobe, real d2) { return lobe->numbers[0]; }

SCATTERS(lambertian)
