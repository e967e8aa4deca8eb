// No polynomial in x and y. The same verb as polynomial_chebyshev.cl.
INLINE void polynomial_add(__constant Scene *scene, realv x_mm, realv y_mm, realv *sum, realv *slope_x,
                           realv *slope_y) {}
