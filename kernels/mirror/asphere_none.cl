// No aspheric terms. The same verbs as asphere_even.cl.
INLINE void asphere_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x, realv *slope_y) {}

INLINE realv asphere_guess(__constant Scene *scene, realv x_mm, realv y_mm) { return 0; }
