// An interface between two media: Snell's law and Fresnel's amplitudes. Frame: the element's.
// M. Born, E. Wolf, Principles of Optics, section 1.5.
#include "interaction.cl"

// A ray at an interface: refractive index and cosine on the incoming side and beyond; total: total reflection.
typedef struct {
    realv index_in, index_out, cosine_in, cosine_out;
    maskv total;
    vec3v beyond;   // refracted direction
} Refraction;

INLINE Refraction refract(__constant Element *element, const Interaction *at) {
    const realv along_normal = dot3(at->along, at->normal);
    const maskv front = along_normal < 0;
    Refraction r;
    r.index_in = front ? (realv)(element->index_front) : (realv)(element->index_back);
    r.index_out = front ? (realv)(element->index_back) : (realv)(element->index_front);
    r.cosine_in = front ? -along_normal : along_normal;
    const realv ratio = r.index_in / r.index_out;
    const realv square = 1 - ratio * ratio * (1 - r.cosine_in * r.cosine_in);
    r.total = square <= 0;
    r.cosine_out = real_sqrt(r.total ? (realv)(0) : square);
    const realv turn = (front ? (realv)(1) : (realv)(-1)) * (ratio * r.cosine_in - r.cosine_out);
    r.beyond = (vec3v){ratio * at->along.x + turn * at->normal.x, ratio * at->along.y + turn * at->normal.y,
                       ratio * at->along.z + turn * at->normal.z};
    return r;
}

// Fresnel's reflection amplitudes for s and p polarisation, from the cosines of the angles on both sides.
INLINE realv amplitude_s(realv index_in, realv index_out, realv cosine_in, realv cosine_out) {
    return (index_in * cosine_in - index_out * cosine_out) / (index_in * cosine_in + index_out * cosine_out);
}
INLINE realv amplitude_p(realv index_in, realv index_out, realv cosine_in, realv cosine_out) {
    return (index_out * cosine_in - index_in * cosine_out) / (index_out * cosine_in + index_in * cosine_out);
}
