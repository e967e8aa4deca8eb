// A mirror that scatters: what is left reflects; and towards the camera, which chance alone would hardly ever find, a ray
// of its own goes with the weight of what scatters there (next-event estimation). Light scattered elsewhere is let go.
#include "interaction.cl"
#include "uniform.cl"
#include "scatter_*.cl"

enum { USE_SCATTER = 64, USE_SCATTER_RADIUS, USE_SCATTER_ANGLE };   // of a ray's random words, beside the elements' numbers

INLINE void interact_scattering(__constant Element *element, Interaction *at) {
    at->goes = mirrored(at->along, at->normal);
    at->weight = element->reflectance * (1 - element->scattered);
    at->ends = dot3(at->along, at->normal) >= 0;
}

// A ray towards a random point of the camera's aperture, in the world: its direction; what its weight is of the specular
// one's, without the BSDF; and the square of its distance from the specular direction in direction cosines.
typedef struct { vec3v along; realv weight, distance2; } Aimed;

INLINE Aimed aim_at_camera(__constant Scene *scene, const PathJob *job, __constant Element *element, const Rays *rays, int v,
                           uintv low, uintv high, vec3v normal) {
    realv a, b;
    unit_disk(path_word(rays->key[v], low, high, USE_SCATTER_RADIUS), path_word(rays->key[v], low, high, USE_SCATTER_ANGLE),
              &a, &b);
    __constant real *x = scene->camera.axis_x, *y = scene->camera.axis_y, *z = scene->camera.axis_z;
    const real *target = job->aperture[element->group];
    const realv u = scene->aperture_radius * a, w = scene->aperture_radius * b;
    const vec3v to = {target[0] + x[0] * u + y[0] * w - rays->x[v], target[1] + x[1] * u + y[1] * w - rays->y[v],
                      target[2] + x[2] * u + y[2] * w - rays->z[v]};
    const realv inverse = 1 / real_sqrt(dot3(to, to));
    Aimed aimed;
    aimed.along = (vec3v){to.x * inverse, to.y * inverse, to.z * inverse};
    const vec3v off = {aimed.along.x - rays->dx[v], aimed.along.y - rays->dy[v], aimed.along.z - rays->dz[v]};
    const realv along_normal = dot3(off, normal);
    aimed.distance2 = dot3(off, off) - along_normal * along_normal;
    const realv leaving = dot3(aimed.along, normal);
    const realv arriving = z[0] * aimed.along.x + z[1] * aimed.along.y + z[2] * aimed.along.z;
    const realv area = (real)M_PI_F * scene->aperture_radius2 * inverse * inverse;
    const maskv seen = (leaving > 0) & (arriving > 0);
    aimed.weight = seen ? leaving * arriving * area / (1 - element->scattered) : (realv)(0);
    return aimed;
}
