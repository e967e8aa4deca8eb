// An interface between two media, bare or with a given reflectance.
#include "refraction.cl"
#include "branch_*.cl"

// Reflectance for unpolarised light.
INLINE realv refractor_reflectance(__constant Element *element, const Refraction *r) {
    const realv s = amplitude_s(r->index_in, r->index_out, r->cosine_in, r->cosine_out);
    const realv p = amplitude_p(r->index_in, r->index_out, r->cosine_in, r->cosine_out);
    const realv reflectance = element->reflectance < 0 ? (s * s + p * p) / 2 : (realv)(element->reflectance);
    return r->total ? (realv)(1) : reflectance;
}

INLINE void interact_refractor(__constant Element *element, Interaction *at) {
    const Refraction r = refract(element, at);
    branch(element, at, refractor_reflectance(element, &r), r.beyond);
}
