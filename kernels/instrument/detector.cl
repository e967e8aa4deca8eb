// Where light that passed the camera's aperture lands on the detector. Frame: the camera's. Unit: mm.
#include "camera_*.cl"

// The paraxial lens turns slope (p, q) at (a, b) into (p - a/f, q - b/f). The image is stored upright, so the
// detector's coordinates are negated. Returns the pixel's number, or -1 off the detector.
INLINE int detector_pixel(__constant Scene *scene, real a, real b, real slope_a, real slope_b) {
    const real image_x = -(a + scene->image_distance * (slope_a - a * scene->inverse_focal_length));
    const real image_y = -(b + scene->image_distance * (slope_b - b * scene->inverse_focal_length));
    return camera_pixel(scene, image_x, image_y);
}
