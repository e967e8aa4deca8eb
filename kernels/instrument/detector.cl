// The camera behind its aperture: paraxial lens and detector grid. Frame: the camera's. Unit: mm.
#include "simd_*.cl"

// Scalar, because few rays pass the aperture.
// The paraxial lens turns slope (p, q) at (a, b) into (p - a/f, q - b/f). The image is stored upright, so the
// detector's coordinates are negated. Returns the pixel's number row * columns + column, or -1 off the detector.
INLINE int detector_pixel(__constant Scene *scene, real a, real b, real slope_a, real slope_b) {
    const real image_x = -(a + scene->image_distance * (slope_a - a * scene->inverse_focal_length));
    const real image_y = -(b + scene->image_distance * (slope_b - b * scene->inverse_focal_length));
    const int columns = scene->detector_columns, rows = scene->detector_rows;
    const real column = image_x * scene->inverse_detector_pitch + (real)0.5 * columns;
    const real row = image_y * scene->inverse_detector_pitch + (real)0.5 * rows;
    const bool inside = column >= 0 && column < columns && row >= 0 && row < rows;
    return inside ? (int)row * columns + (int)column : -1;
}
