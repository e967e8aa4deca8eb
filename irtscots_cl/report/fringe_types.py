"""Types of the facts about measurements by fringes, Gray codes and dots, named as in report.json."""

from typing import NotRequired, TypedDict

from irtscots_cl.report.along_axes import AlongAxes


class HarmonicFacts(TypedDict):
    """What a screen's gamma would do to the phases of an axis were it left in them, by series: closed_form_rad, the
    largest without blur; bias_rad, the largest over the pixels used. height_nm: rms of the heights' change by both
    axes, piston and tilt removed."""

    gamma: float
    gamma_standard_error: float
    closed_form_rad: list[float]
    bias_rad: list[float]
    height_nm: float


class PhotonTransferFacts(TypedDict):
    """A camera's noise against light. electrons: NaN where the noise does not grow clearly with the light. light,
    variance: of samples of nearly equal light, above dark. departs: largest difference of a variance from the line,
    over the line."""

    electrons_per_count: float
    electrons_per_count_standard_error: float
    read_noise_counts: float
    read_noise_electrons: float
    light_counts: list[float]
    variance_counts2: list[float]
    variance_counts2_standard_error: list[float]
    departs: float


class FringeFacts(TypedDict):
    """What the fringes say. periods: over the screen. standard_error_mm: of the places on the screen, the median.
    excluded: the mirror's pixels by the reason why they are not used, "used" among them. noise: of a sample of median
    brightness, in counts, by axis."""

    periods: dict[str, list[float]]
    standard_error_mm: AlongAxes
    modulation: AlongAxes
    pixels_with_wrong_order: float
    excluded: NotRequired[dict[str, int]]
    noise: NotRequired[dict[str, float]]
    photon_transfer: NotRequired[PhotonTransferFacts]
    harmonics: NotRequired[dict[str, HarmonicFacts]]


class PlaceFacts(TypedDict):
    """What a Gray code or dots say. standard_error_mm: of the places on the screen, the median. excluded: the mirror's
    pixels by the reason why they are not used, "used" among them. share_floor: error of a plane's share of black and
    white that noise does not explain, by axis. dots: those shown in all frames, found and matched. distance_px: of the
    used pixels from the next dot's image, median and farthest."""

    standard_error_mm: AlongAxes
    excluded: dict[str, int]
    pixels_with_wrong_cell: NotRequired[float]
    share_floor: NotRequired[AlongAxes]
    dots: NotRequired[dict[str, int]]
    distance_px: NotRequired[dict[str, float]]
