// An interface with one coating layer, a quarter of a wavelength thick: its reflectance at that wavelength.
// M. Born, E. Wolf, Principles of Optics, section 1.6.4.
#include "refraction.cl"
#include "branch_*.cl"

// cos(pi c) for c in 0 ... 1, as 1 - 2 sin(pi c / 2)^2 with the polynomial of uniform.cl.
INLINE realv cosine_of_turn(realv c) {
    const realv t = c / 2, q = t * t;
    const realv sine = t * ((((S4 * q + S3) * q + S2) * q + S1) * q + S0);
    return 1 - 2 * sine * sine;
}

// Reflectance of a layer between interfaces with amplitudes first and second; twice: cosine of twice the layer's phase.
INLINE realv layer(realv first, realv second, realv twice) {
    const realv both = first * second;
    return (first * first + second * second + 2 * both * twice) / (1 + both * both + 2 * both * twice);
}

// Reflectance for unpolarised light.
INLINE realv coated_reflectance(__constant Element *element, const Refraction *r) {
    const realv index = element->coating_index, ratio = r->index_in / index;
    const realv square = 1 - ratio * ratio * (1 - r->cosine_in * r->cosine_in);
    const realv cosine = real_sqrt(square < 0 ? (realv)(0) : square);   // below 0 only for total reflection
    const realv twice = cosine_of_turn(cosine);
    const realv s = layer(amplitude_s(r->index_in, index, r->cosine_in, cosine),
                          amplitude_s(index, r->index_out, cosine, r->cosine_out), twice);
    const realv p = layer(amplitude_p(r->index_in, index, r->cosine_in, cosine),
                          amplitude_p(index, r->index_out, cosine, r->cosine_out), twice);
    return r->total ? (realv)(1) : (s + p) / 2;
}

INLINE void interact_coated(__constant Element *element, Interaction *at) {
    const Refraction r = refract(element, at);
    branch(element, at, coated_reflectance(element, &r), r.beyond);
}
