// A coating layer, a quarter of a wavelength thick, on an interface: light in it. M. Born, E. Wolf, Principles of Optics,
// section 1.6.4.
#include "refraction.cl"
#include "uniform.cl"

// cos(pi c) for c in 0 ... 1, as 1 - 2 sin(pi c / 2)^2 with the polynomial of uniform.cl.
INLINE realv cosine_of_turn(realv c) {
    const realv t = c / 2, q = t * t;
    const realv sine = t * ((((S4 * q + S3) * q + S2) * q + S1) * q + S0);
    return 1 - 2 * sine * sine;
}

// Cosine of the light's angle in the layer.
INLINE realv layer_cosine(__constant Element *element, const Refraction *r) {
    const realv ratio = r->index_in / element->coating_index;
    const realv square = 1 - ratio * ratio * (1 - r->cosine_in * r->cosine_in);
    return real_sqrt(square < 0 ? (realv)(0) : square);   // below 0 only for total reflection
}
