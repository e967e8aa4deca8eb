// Interfaces for light whose linear polarisation is carried along: Stokes' parameters, turned into the plane of incidence.
// M. Born, E. Wolf, Principles of Optics, sections 1.5.2, 1.5.4 and 1.6.4.
#include "layer.cl"
#include "carry_*.cl"

// What an interface does to both polarisations: their reflectances, and the factors of u in the reflected and in the
// refracted light, Re(r_s r_p*) and Re(t_s t_p*) with the fluxes' ratio.
typedef struct { realv s, p, u_mirrored, u_passed; } Interface;

// The light that is reflected and the light that goes on.
typedef struct { Stokes mirrored, passed; } Parted;

// Complex numbers.
typedef struct { realv re, im; } Complex;
INLINE Complex times_conjugate(Complex a, Complex b) {
    return (Complex){a.re * b.re + a.im * b.im, a.im * b.re - a.re * b.im};
}

// Total reflection: r = (a - i b) / (a + i b), with a and b as below; only the difference of the phases counts.
INLINE Interface total_interface(const Refraction *r) {
    const realv ratio = r->index_in / r->index_out;
    const realv square = ratio * ratio * (1 - r->cosine_in * r->cosine_in) - 1;
    const realv depth = real_sqrt(square > 0 ? square : (realv)(0));   // cos(theta_2) / i
    const realv a_s = r->index_in * r->cosine_in, b_s = r->index_out * depth;
    const realv a_p = r->index_out * r->cosine_in, b_p = r->index_in * depth;
    const realv size = (a_s * a_s + b_s * b_s) * (a_p * a_p + b_p * b_p);
    const realv cosines = (a_s * a_s - b_s * b_s) * (a_p * a_p - b_p * b_p), sines = 4 * a_s * b_s * a_p * b_p;
    return (Interface){(realv)(1), (realv)(1), (cosines + sines) / size, (realv)(0)};
}

INLINE realv blend(maskv mask, realv yes, realv no) { return mask ? yes : no; }

INLINE Interface or_total(const Refraction *r, Interface open) {
    if (!any_lane(r->total)) return open;
    const Interface total = total_interface(r);
    return (Interface){blend(r->total, total.s, open.s), blend(r->total, total.p, open.p),
                       blend(r->total, total.u_mirrored, open.u_mirrored),
                       blend(r->total, total.u_passed, open.u_passed)};
}

// A given reflectance holds for both polarisations; a mirror image turns the sign of u.
INLINE Interface refractor_interface(__constant Element *element, const Refraction *r) {
    const realv given = (realv)(element->reflectance);
    if (element->reflectance >= 0) return or_total(r, (Interface){given, given, -given, 1 - given});
    const realv s = amplitude_s(r->index_in, r->index_out, r->cosine_in, r->cosine_out);
    const realv p = amplitude_p(r->index_in, r->index_out, r->cosine_in, r->cosine_out);
    return or_total(r, (Interface){s * s, p * p, s * p, real_sqrt((1 - s * s) * (1 - p * p))});
}

// Amplitude of a layer: (first + second e) / (1 + first second e), e = exp(2 i phase), as numerator and denominator.
typedef struct { Complex over, under; } Layer;
INLINE Layer layer_of(realv first, realv second, Complex e) {
    const realv both = first * second;
    return (Layer){{first + second * e.re, second * e.im}, {1 + both * e.re, both * e.im}};
}
INLINE realv size2(Complex a) { return a.re * a.re + a.im * a.im; }

INLINE Interface coated_interface(__constant Element *element, const Refraction *r) {
    const realv index = element->coating_index, cosine = layer_cosine(element, r), turn = cosine_of_turn(cosine);
    const realv square = 1 - turn * turn;
    const Complex e = {turn, real_sqrt(square > 0 ? square : (realv)(0))};
    const Layer s = layer_of(amplitude_s(r->index_in, index, r->cosine_in, cosine),
                             amplitude_s(index, r->index_out, cosine, r->cosine_out), e);
    const Layer p = layer_of(amplitude_p(r->index_in, index, r->cosine_in, cosine),
                             amplitude_p(index, r->index_out, cosine, r->cosine_out), e);
    const realv reflected_s = size2(s.over) / size2(s.under), reflected_p = size2(p.over) / size2(p.under);
    const realv under = size2(s.under) * size2(p.under);
    const Complex tops = times_conjugate(s.over, p.over), bottoms = times_conjugate(p.under, s.under);
    const realv u_mirrored = (tops.re * bottoms.re - tops.im * bottoms.im) / under;
    const realv passed = (1 - reflected_s) * (1 - reflected_p);
    const realv u_passed = real_sqrt(passed > 0 ? passed : (realv)(0)) * bottoms.re / real_sqrt(under);
    return or_total(r, (Interface){reflected_s, reflected_p, u_mirrored, u_passed});
}

INLINE vec3v cross3(vec3v a, vec3v b) {
    return (vec3v){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

#define LEAST_SINE2 ((real)1e-8)   // of incidence; below it any direction across the ray will do

// Unit vector at right angles to the plane of incidence.
INLINE vec3v across(const Interaction *at) {
    const vec3v axis = {(realv)(1), (realv)(0), (realv)(0)}, other = {(realv)(0), (realv)(1), (realv)(0)};
    const realv x = at->along.x;
    vec3v s = cross3(at->along, at->normal);
    s = blend3(dot3(s, s) < LEAST_SINE2, cross3(at->along, blend3(x * x < (realv)(0.5), axis, other)), s);
    const realv inverse = 1 / real_sqrt(dot3(s, s));
    return (vec3v){s.x * inverse, s.y * inverse, s.z * inverse};
}

// The light that arrives, told from the plane of incidence.
INLINE Stokes turned(const Interaction *at) {
    const vec3v s = across(at), e = at->light.e;
    const realv cosine = dot3(e, s), sine = dot3(cross3(at->along, e), s);
    const realv twice_cosine = cosine * cosine - sine * sine, twice_sine = 2 * cosine * sine;
    return (Stokes){at->light.q * twice_cosine + at->light.u * twice_sine,
                    at->light.u * twice_cosine - at->light.q * twice_sine, s};
}

// The light of shares s and p of both polarisations, of a total share.
INLINE Stokes part_of(const Stokes *light, realv s, realv p, realv u, realv share) {
    const realv inverse = share > 0 ? 1 / share : (realv)(0);
    return (Stokes){(s * (1 + light->q) - p * (1 - light->q)) / 2 * inverse, u * light->u * inverse, light->e};
}

// Share of the light that is reflected.
INLINE realv part(const Interaction *at, const Interface *interface, Parted *parted) {
    const Stokes light = turned(at);
    const realv share = (interface->s * (1 + light.q) + interface->p * (1 - light.q)) / 2;
    parted->mirrored = part_of(&light, interface->s, interface->p, interface->u_mirrored, share);
    parted->passed = part_of(&light, 1 - interface->s, 1 - interface->p, interface->u_passed, 1 - share);
    return share;
}
INLINE realv refractor_share(__constant Element *element, const Interaction *at, const Refraction *r, Parted *parted) {
    const Interface interface = refractor_interface(element, r);
    return part(at, &interface, parted);
}
INLINE realv coated_share(__constant Element *element, const Interaction *at, const Refraction *r, Parted *parted) {
    const Interface interface = coated_interface(element, r);
    return part(at, &interface, parted);
}

// The light of the ray that leaves, and of the mirrored one that may split from it.
INLINE void parted_leave(Interaction *at, const Parted *parted) {
    const maskv mirrored = to_mask(at->event == EVENT_GHOST);
    at->light.q = mirrored ? parted->mirrored.q : parted->passed.q;
    at->light.u = mirrored ? parted->mirrored.u : parted->passed.u;
    at->light.e = parted->passed.e;
    at->mirrored_light = parted->mirrored;
}
