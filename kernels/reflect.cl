// Law of reflection.
#include "simd_*.cl"

// direction points against the incoming light, normal and the result away from the surface; no vector need be of unit
// length, the result is not: 2 (d.n) n - (n.n) d.
INLINE vec3v reflect(vec3v direction, vec3v normal) {
    const realv dn2 = 2 * (direction.x * normal.x + direction.y * normal.y + direction.z * normal.z);
    const realv nn = normal.x * normal.x + normal.y * normal.y + normal.z * normal.z;
    return (vec3v){dn2 * normal.x - nn * direction.x, dn2 * normal.y - nn * direction.y,
                   dn2 * normal.z - nn * direction.z};
}
