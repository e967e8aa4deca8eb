"""Types of what a picture of the mirror tells, named as in report.json."""

from typing import Any, NotRequired, TypedDict

from irtscots_cl.report.along_axes import AlongAxes


class MaskFacts(TypedDict):
    """chosen_by: "auto", "design" or "file". pixels: by what tells that they see the mirror."""

    chosen_by: str
    pixels: dict[str, int]


class RimFacts(TypedDict):
    """An outline against the design's. scale: 1 for the design's size. residual_px: rms of the edge from the outline
    moved and scaled; noise_px: of it explained by noise. seen: share of the outline whose edge was found."""

    shift_rows_px: float
    shift_columns_px: float
    shift_standard_error_px: float
    scale: float
    scale_standard_error: float
    residual_px: float
    noise_px: float
    blur_px: float
    seen: float


class OutlineFacts(RimFacts):
    """The mirror's rim. shift_mm: on the mirror. hole: of its central hole."""

    shift_mm: AlongAxes
    shift_standard_error_mm: AlongAxes
    hole: NotRequired[RimFacts]


class MarkFacts(TypedDict):
    """A mark. error_mm: place by the design's camera less that of the table; NaN where it was not found."""

    name: str
    found: bool
    row: float
    column: float
    error_mm: AlongAxes
    standard_error_mm: AlongAxes
    left_mm: AlongAxes


class FiducialFacts(TypedDict):
    """rms_mm: of the mapping error; left_mm_rms: without offset, turn and scale of the mirror in the picture.
    suggestion: keys of a scene that would explain them, with the mapping error left."""

    marks: list[MarkFacts]
    rms_mm: float
    left_mm_rms: NotRequired[float]
    offset_mm: NotRequired[AlongAxes]
    offset_standard_error_mm: NotRequired[AlongAxes]
    turn_mrad: NotRequired[float]
    turn_standard_error_mrad: NotRequired[float]
    scale: NotRequired[float]
    scale_standard_error: NotRequired[float]
    suggestion: NotRequired[dict[str, Any]]
