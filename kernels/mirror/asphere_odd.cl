// Aspheric terms of the mirror's design in even and odd powers of r, along z, and their gradient. The same verb as
// asphere_even.cl. Frame: the mirror's, its origin on the parent's axis. Unit: mm.
//
// The height is rho^2 g(t), rho = r / radius, with the polynomial g in t = 2 rho - 1. No term is linear
// in r, so nothing is divided by r. The coefficients come from irtscots_cl/optics/asphere.py.
#include "profile.cl"

// Adds the height [mm] at (x, y) [mm] to *sum, and its slopes to *slope_x and *slope_y.
INLINE void asphere_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x, realv *slope_y) {
    __constant Asphere *asphere = &scene->asphere;
    const realv x = x_mm * asphere->inverse_radius, y = y_mm * asphere->inverse_radius;
    const realv s = x * x + y * y, rho = real_sqrt(s), t = 2 * rho - 1;
    realv g, g_t;
    profile_sum(asphere, t, &g, &g_t);
    const realv over = 2 * (g + rho * g_t) * asphere->inverse_radius;   // slope along r, over r / radius
    *sum += s * g;
    *slope_x += over * x;
    *slope_y += over * y;
}
