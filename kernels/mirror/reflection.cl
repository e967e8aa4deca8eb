// A line meets the mirror and leaves it by the law of reflection. Frame: the world. Unit: mm.
//
// The mirror_*.cl files define the type Meeting, mirror_meet (on the design surface), mirror_deviate (from there to the
// surface as made) and mirror_normal. They are separate stages; trace_forward.cl says why.
#include "line.cl"
#include "mirror_*.cl"

// Direction of the light of a line after reflection at a surface with normal n: 2 (d.n) n - (n.n) d, with d = (p, q, 1)
// against the incoming light. nn: n.n. Neither n nor the result needs unit length.
INLINE vec3v reflect(const Line *line, vec3v n, realv nn) {
    const realv dn2 = 2 * (line->p * n.x + line->q * n.y + n.z);
    return (vec3v){dn2 * n.x - nn * line->p, dn2 * n.y - nn * line->q, dn2 * n.z - nn};
}
