// The camera behind its aperture: a paraxial lens without distortion, and the detector's grid. Frame: the camera's.
// Unit: mm.
#include "simd_*.cl"

// The image point, of the upright image, of a receiver's ray at (s, t) pixels from its centre. Returns how much more
// light the pixel gets there by the lens's distortion: none.
INLINE realv camera_image(__constant Scene *scene, const Receiver *receiver, realv s, realv t, realv *x, realv *y) {
    *x = receiver->x + scene->detector_pitch_x * s;
    *y = receiver->y + scene->detector_pitch_y * t;
    return (realv)(1);
}

// The pixel's number row * columns + column of an image point, or -1 off the detector. Scalar, because few rays pass
// the aperture.
INLINE int camera_pixel(__constant Scene *scene, real x, real y) {
    const int columns = scene->detector_columns, rows = scene->detector_rows;
    const real column = x * scene->inverse_detector_pitch_x + scene->detector_left;
    const real row = y * scene->inverse_detector_pitch_y + scene->detector_top;
    const bool inside = column >= 0 && column < columns && row >= 0 && row < rows;
    return inside ? (int)row * columns + (int)column : -1;
}
