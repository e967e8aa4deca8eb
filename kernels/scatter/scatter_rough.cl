// A Harvey lobe whose total follows from the surface's roughness: 1 - exp(-(phase step)^2), where phase is 2 pi rms
// height / wavelength and step the change of n cos(theta) to the normal, for reflected and for refracted light alike
// (references: tis_of_roughness in irtscots_cl/scene/scatter/models.py). numbers: 1 / total, 1 / l^2, s / 2; tis: what
// the horizon leaves of the lobe's total of 1.
#include "scatter_harvey.cl"

INLINE realv rough_total(const Trace *trace, int number, const Interaction *at) {
    __constant Element *element = &trace->elements[number];
    const realv before = dot3(at->along, at->normal), after = dot3(at->goes, at->normal);
    const realv index_before = before < 0 ? (realv)(element->index_front) : (realv)(element->index_back);
    const realv index_after = after > 0 ? (realv)(element->index_front) : (realv)(element->index_back);
    const realv phase = trace->scatter->lobes[number].phase * (index_after * after - index_before * before);
    realv total;
    for (int k = 0; k < WIDTH; ++k) {
        const real one = ((const real *)&phase)[k];
        ((real *)&total)[k] = -expm1(-one * one);
    }
    return total;
}

INLINE realv rough_left(const Trace *trace, int number, const Interaction *at) {
    return 1 - rough_total(trace, number, at);
}

INLINE void rough_split(const Trace *trace, const Rays *rays, int v, int number, maskv meets, const Interaction *at) {
    __constant Lobe *lobe = &trace->scatter->lobes[number];
    const Scatterers some = scatterers_of(trace, rays, v, number, meets, at);
    if (some.lanes == 0) return;
    const realv scale = rough_total(trace, number, at) / scattered_share(lobe, dot3(at->goes, at->normal));
    for (ulong lanes = some.lanes; lanes != 0; lanes &= lanes - 1) {
        const int k = lowest_lane(lanes);
        const Scattered scattered = scatter_lane(trace, rays, v, k, lobe, &some);
        if (scattered.density > 0)
            scatter_split(trace, rays, v, k, lobe, at, &scattered,
                          ((const real *)&scale)[k] * bsdf_harvey(lobe, scattered.d2));
    }
}
