// A line meets the mirror and leaves it by the law of reflection. World frame, mm.
//
// The mirror_*.cl files define where: the type Meeting, mirror_meet (on the design surface), mirror_deviate (from there
// to the surface as made) and mirror_normal. They are stages of their own: see trace_forward.cl.
#include "simd_*.cl"

// The line (x0 + p z, y0 + q z, z): light on it runs towards -z.
typedef struct { realv x0, y0, p, q; } Line;

#include "mirror_*.cl"

// Direction, of any length, that the light of a line leaves in from a surface with the normal n, of any length too.
// With d = (p, q, 1) against the incoming light: 2 (d.n) n - (n.n) d.
INLINE vec3v reflect(const Line *line, vec3v n) {
    const realv dn2 = 2 * (line->p * n.x + line->q * n.y + n.z);
    const realv nn = n.x * n.x + n.y * n.y + n.z * n.z;
    return (vec3v){dn2 * n.x - nn * line->p, dn2 * n.y - nn * line->q, dn2 * n.z - nn};
}
