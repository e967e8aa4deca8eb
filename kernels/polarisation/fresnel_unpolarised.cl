// Interfaces for unpolarised light: the mean of both polarisations, at every interface by itself.
#include "layer.cl"

// Reflectance for unpolarised light.
INLINE realv refractor_reflectance(__constant Element *element, const Refraction *r) {
    const realv s = amplitude_s(r->index_in, r->index_out, r->cosine_in, r->cosine_out);
    const realv p = amplitude_p(r->index_in, r->index_out, r->cosine_in, r->cosine_out);
    const realv reflectance = element->reflectance < 0 ? (s * s + p * p) / 2 : (realv)(element->reflectance);
    return r->total ? (realv)(1) : reflectance;
}

// Reflectance of a layer between interfaces with amplitudes first and second; twice: cosine of twice the layer's phase.
INLINE realv layer(realv first, realv second, realv twice) {
    const realv both = first * second;
    return (first * first + second * second + 2 * both * twice) / (1 + both * both + 2 * both * twice);
}

// Reflectance for unpolarised light.
INLINE realv coated_reflectance(__constant Element *element, const Refraction *r) {
    const realv index = element->coating_index, cosine = layer_cosine(element, r), twice = cosine_of_turn(cosine);
    const realv s = layer(amplitude_s(r->index_in, index, r->cosine_in, cosine),
                          amplitude_s(index, r->index_out, cosine, r->cosine_out), twice);
    const realv p = layer(amplitude_p(r->index_in, index, r->cosine_in, cosine),
                          amplitude_p(index, r->index_out, cosine, r->cosine_out), twice);
    return r->total ? (realv)(1) : (s + p) / 2;
}

// The share of the light that an interface reflects, and what is to be done about its polarisation: nothing.
typedef struct { char none; } Parted;
INLINE realv refractor_share(__constant Element *element, const Interaction *at, const Refraction *r, Parted *parted) {
    return refractor_reflectance(element, r);
}
INLINE realv coated_share(__constant Element *element, const Interaction *at, const Refraction *r, Parted *parted) {
    return coated_reflectance(element, r);
}
INLINE void parted_leave(Interaction *at, const Parted *parted) {}
