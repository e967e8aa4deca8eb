// The Harvey model: BSDF [1/sr] = b0 (1 + (d / l)^2)^(s / 2), where d is the distance in direction cosines from the
// specular direction.
// numbers: b0, 1 / l^2, s / 2.
#include "scattered.cl"

INLINE real bsdf_harvey(__constant Lobe *lobe, real d2) {
    return lobe->numbers[0] * pow(1 + d2 * lobe->numbers[1], lobe->numbers[2]);
}

SCATTERS(harvey)
