// A line meets the mirror and leaves it by the law of reflection. World frame, mm.
#include "mirror_*.cl"

// The line (x0 + p z, y0 + q z, z): light on it runs towards -z.
typedef struct { realv x0, y0, p, q; } Line;

// Where a line met the mirror and the direction (of any length) that it left in; false: it missed the aperture.
typedef struct { vec3v point, direction; maskv on_mirror; } Reflection;

// With d = (p, q, 1) against the incoming light and a normal n of any length: 2 (d.n) n - (n.n) d.
INLINE Reflection mirror_reflect(__constant Scene *scene, const Line *line) {
    Reflection ray;
    vec3v n;
    ray.on_mirror = mirror_meet(scene, line->x0, line->y0, line->p, line->q, &ray.point, &n);
    const realv dn2 = 2 * (line->p * n.x + line->q * n.y + n.z);
    const realv nn = n.x * n.x + n.y * n.y + n.z * n.z;
    ray.direction = (vec3v){dn2 * n.x - nn * line->p, dn2 * n.y - nn * line->q, dn2 * n.z - nn};
    return ray;
}
