"""The keys of report.json and of what `irtscots paths` tells, and what stands under each."""

from typing import NotRequired, TypedDict

from irtscots_cl.report.along_axes import AlongAxes
from irtscots_cl.report.fringe_types import FringeFacts, PlaceFacts
from irtscots_cl.report.image_types import CameraFacts, ImageFileFacts
from irtscots_cl.report.picture_types import FiducialFacts, MaskFacts, OutlineFacts


class DeviceFacts(TypedDict):
    """Where it was traced. devices: each of many. workers: of a Dask cluster, by address."""

    index: str
    name: str
    platform: str
    driver: str
    kind: str
    compute_units: int
    devices: NotRequired[list["DeviceFacts"]]
    workers: NotRequired[dict[str, "WorkerFacts"]]


class WorkerFacts(TypedDict):
    """What one worker of a Dask cluster traced, and on which device."""

    rays: int
    tasks: int
    seconds: float
    kernels: float
    device: DeviceFacts


class TraceSeconds(TypedDict):
    """kernels: the part of trace that kernels ran."""

    build: float
    trace: float
    kernels: float


class Seconds(TraceSeconds):
    """Of a run, in parts that add up to total; kernels is within trace. start, store, figures, report: of a command."""

    start: NotRequired[float]
    prepare: float
    reconstruct: float
    predict: float
    store: NotRequired[float]
    figures: NotRequired[float]
    report: NotRequired[float]
    total: float


class Ledger(TypedDict):
    """Rays by fate; all but "launched" add up to it."""

    launched: int
    missed_mirror: int
    off_detector: int
    clipped: int
    absorbed: int
    off_screen: int
    detected: int
    failed: int


class HeightErrors(TypedDict):
    """By what was removed before: rms [nm], or its standard error."""

    piston: float
    piston_tilt: float
    piston_tilt_power: float


class Refused(TypedDict):
    """Pixels on the mirror whose light curves were refused, by the reason."""

    empty: int
    clipped: int
    stray: int
    saturated: int
    masked: int


class CheckFacts(TypedDict):
    """One check of the images. level: ok, warning or error. false_alarm: chance that good images fail it.
    cost_nm: rms of the height that what it names costs, NaN where that is not known."""

    name: str
    level: str
    value: float
    limit: float
    false_alarm: float
    text: str
    cost_nm: float


class Predicted(TypedDict):
    """The error that the images and the design let expect. height_systematic_nm_rms: without noise and rounding, line
    sampling included. bound: why the height error is a bound and no estimate; "" for an estimate."""

    slope_error_urad_rms: AlongAxes
    slope_ray_noise_urad_rms: AlongAxes
    slope_line_sampling_urad_rms: AlongAxes
    height_error_nm_rms_piston_tilt: float
    height_ray_noise_nm_rms: float
    height_line_sampling_nm_rms: float
    height_systematic_nm_rms: float
    height_rounding_nm_rms: float
    bound: str


class ErrorPart(TypedDict):
    """One part of the height error."""

    part: str
    slope_urad_rms: AlongAxes
    height_nm_rms: float


class ZernikeFacts(TypedDict):
    """A Noll coefficient of the deviation: the scene's and the measured one."""

    noll: int
    input_um: float
    output_um: float
    standard_error_um: float
    expected_um: float
    inflation: float


class MeasuredZernike(TypedDict):
    """A Noll coefficient of a lab's mirror."""

    noll: int
    output_um: float
    standard_error_um: float
    inflation: float


class ZernikeFitFacts(TypedDict):
    """How the Zernike terms were fitted. dropped: Noll terms that the pixels cannot separate from the others."""

    kind: str
    radius_mm: float
    obscuration_ratio: float
    condition: float
    condition_of_all: float
    dropped: list[int]
    residual_nm_rms: float
    standard_errors_from: str


class MisfitFacts(TypedDict):
    """The part of the slopes that no surface has, what noise and predicted line sampling leave of it, and its limit."""

    urad_rms: float
    noise_urad_rms: float
    systematic_urad_rms: float
    limit_urad_rms: float
    suspicious: bool


class IslandFacts(TypedDict):
    """One island of the mask."""

    pixels: int
    group: int
    piston_known: bool
    piston_standard_error_nm: float
    nm_rms: float


class IslandReport(TypedDict):
    """Islands of the mask. groups: of islands joined with each other, 1 if all are. largest: at most 20 of them."""

    count: int
    groups: int
    pixels_in_heights: int
    pixels_alone: int
    join_limit: float
    own_pistons_nm_rms: float
    largest: list[IslandFacts]


class SettingFacts(TypedDict):
    """A way to trace and to measure, and what was predicted of it."""

    estimator: str
    sampler: str
    precision: str
    smoothing: bool
    measure: str
    rays_per_pixel: int
    height_nm: float
    floor_nm: float
    seconds: float


class Target(TypedDict):
    """What was wanted, predicted and reached by a run with --target-nm."""

    target_nm: float
    reached_nm: float
    met: bool
    attempts: int
    predicted: SettingFacts


class NoiseFacts(TypedDict):
    """What a run's camera and screen did to the images. detector, screen: the keys of the scene's tables that were
    given. electrons_per_w, electrons_at_peak: of a frame of a nominal pixel, NaN in images in W; saturation: in the
    images' unit, infinite without a limit."""

    unit: str
    electrons_per_w: float
    electrons_at_peak: float
    saturation: float
    detector: dict[str, object]
    screen: dict[str, object]


class Report(TypedDict):
    """report.json. Numbers that do not exist are NaN here and null in the file."""

    scene: str
    device: DeviceFacts
    estimator: str
    sampler: str
    precision: str
    seed: int
    aim: str
    overfill: float
    smoothing: bool
    measure: str
    refinement_updates_nm: list[float]
    refinement_converged: bool | None
    replicates: int
    versions: dict[str, str]
    rays_total: int
    rays_per_pixel: int
    rays_per_second: float
    seconds: Seconds
    ledger: Ledger
    pixels_used: int
    light_curves_refused: Refused
    pixels_with_traced_light: int
    pixels_without_model: int
    slope_error_urad_rms: AlongAxes
    slope_error_urad_rms_standard_error: AlongAxes
    height_error_nm_rms: HeightErrors
    height_error_nm_rms_standard_error: HeightErrors
    height_standard_error_nm: float
    predicted: Predicted
    error_parts: list[ErrorPart]
    zernike: list[ZernikeFacts]
    zernike_fit: ZernikeFitFacts
    islands: IslandReport
    integration_misfit: MisfitFacts
    warnings: list[str]
    target: NotRequired[Target]
    noise: NotRequired[NoiseFacts]
    checks: NotRequired[list[CheckFacts]]


class Staying(TypedDict):
    """Light that stays in the test, by where its rays end."""

    end: str
    flux_w: float
    flux_standard_error_w: float


class StrayFacts(TypedDict):
    """One kind of stray light, and what it adds to the height."""

    kind: str
    of_direct: float
    height_nm_rms: float
    height_nm_rms_standard_error: float
    lost_pixels: int


class PathRow(TypedDict):
    """One path of light from the screen to the detector."""

    path: str
    kind: str
    flux_w: float
    flux_standard_error_w: float
    of_direct: float
    rays: int
    focus_mm: float
    blur_mm: float


class PathReport(TypedDict):
    """What `irtscots paths` tells of a non-sequential trace. ends: rays by where they ended. bounce_limit: events after
    which rays were given up. measure: how images became heights."""

    scene: str
    device: DeviceFacts
    sampler: str
    precision: str
    seed: int
    replicates: int
    measure: str
    rays_total: int
    seconds: TraceSeconds
    rays_per_second: float
    bounce_limit: int
    ends: dict[str, int]
    launched_w: float
    direct_w: float
    staying: list[Staying]
    stray_light: list[StrayFacts]
    paths: list[PathRow]


class GeometryFacts(TypedDict):
    """Where the camera saw a mirror whose place is known from its outline and its distance from the screen.

    display: the file that the screen's shape comes from. corners_px: (column, row) in the images as stored, in the
    order of the facet's file. corner_misfit_px: rms distance of the facet's corners from them. distance_mm: measured,
    from the mirror's point to the screen; distance_by_corners_mm: by its outline alone. turn_mrad: between the mirror's
    normal by the outline and by the slopes, which counts. focal_lengths_m: of the paraboloid that the slopes fit, along
    x and y.
    """

    display: str
    corners_px: list[list[float]]
    corner_misfit_px: float
    distance_mm: float
    distance_by_corners_mm: float
    turn_mrad: float
    focal_lengths_m: AlongAxes


class MeasuredFacts(TypedDict):
    """What `irtscots reconstruct` tells of a lab's images, named as in report.json.

    height_standard_error_nm: rms over the pixels used, from the noise in the images, piston and tilt removed.
    deviation_nm_pv: from the lowest to the highest pixel, piston and tilt removed.
    of_bound: how the centroids' standard errors compare with the least that the samples allow (Cramer-Rao), the
    median over the pixels.
    """

    scene: str
    measure: str
    refinement_updates_nm: list[float]
    refinement_converged: bool | None
    pixels_used: int
    light_curves_refused: Refused
    pixels_with_traced_light: int
    pixels_without_model: int
    deviation_nm_rms: HeightErrors
    deviation_nm_pv: float
    zernike: list[MeasuredZernike]
    zernike_fit: ZernikeFitFacts
    islands: IslandReport
    integration_misfit: MisfitFacts
    slope_standard_error_urad: AlongAxes
    height_standard_error_nm: float
    of_bound: AlongAxes
    checks: list[CheckFacts]
    fringes: NotRequired[FringeFacts]
    images: NotRequired[ImageFileFacts]
    camera: NotRequired[CameraFacts]
    places: NotRequired[PlaceFacts]
    geometry: NotRequired[GeometryFacts]
    mask: NotRequired[MaskFacts]
    outline: NotRequired[OutlineFacts]
    fiducials: NotRequired[FiducialFacts]
