// The camera behind its aperture: a lens with distortion, and the detector's grid. The verbs are those of
// camera_plain.cl. Frame: the camera's. Unit: mm. The formula is OpenCV's: irtscots_cl/maths/lens_distortion.py.
#include "lens_*.cl"

// The distortion's inverse is smooth: over one pixel, the host gives it as a quadratic (tracing/packing/image_maps.py).
// The light follows the area that the quadratic gives a pixel's parts.
INLINE realv camera_image(__constant Scene *scene, const Receiver *receiver, realv s, realv t, realv *x, realv *y) {
    const Image *image = &receiver->image;
    *x = receiver->x + s * (image->x_s + image->x_ss * s + image->x_st * t) + t * (image->x_t + image->x_tt * t);
    *y = receiver->y + s * (image->y_s + image->y_ss * s + image->y_st * t) + t * (image->y_t + image->y_tt * t);
    const realv x_by_s = image->x_s + 2 * image->x_ss * s + image->x_st * t;
    const realv x_by_t = image->x_t + image->x_st * s + 2 * image->x_tt * t;
    const realv y_by_s = image->y_s + 2 * image->y_ss * s + image->y_st * t;
    const realv y_by_t = image->y_t + image->y_st * s + 2 * image->y_tt * t;
    return (x_by_s * y_by_t - x_by_t * y_by_s) * scene->lens.inverse_pixel_area;
}

// Beyond the radius of the image's farthest corner the polynomial may fold back into it: such light is off the detector.
INLINE int camera_pixel(__constant Scene *scene, real image_x, real image_y) {
    __constant Lens *lens = &scene->lens;
    const int columns = scene->detector_columns, rows = scene->detector_rows;
    const real x = image_x * scene->inverse_image_distance + lens->shift_x;
    const real y = image_y * scene->inverse_image_distance + lens->shift_y;
    const real r2 = x * x + y * y;
    const real common = lens_radial(lens, r2) + 2 * (lens->p1 * y + lens->p2 * x);
    const real moved_x = x * common + lens->p2 * r2, moved_y = y * common + lens->p1 * r2;
    const real column = (x + moved_x) * lens->focal_x + scene->detector_left;
    const real row = (y + moved_y) * lens->focal_y + scene->detector_top;
    const bool inside = r2 <= lens->most2 && column >= 0 && column < columns && row >= 0 && row < rows;
    return inside ? (int)row * columns + (int)column : -1;
}
