// No Zernike deviation. The same verb as zernike_power.cl.
INLINE void zernike_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x, realv *slope_y) {}
