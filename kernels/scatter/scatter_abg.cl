// The ABg model: BSDF [1/sr] = A / (B + d^g); see scatter_harvey.cl. numbers: A, B, g / 2.
#include "scattered.cl"

INLINE real bsdf_abg(__constant Lobe *lobe, real d2) {
    return lobe->numbers[0] / (lobe->numbers[1] + pow(d2, lobe->numbers[2]));
}

SCATTERS(abg)
