"""Error sources that were measured together: their covariance, as `irtscots calibrate` writes it.

The root L of a covariance, L L^T, is its lower triangular (Cholesky) one; sources of no freedom of their own, such as
two that are perfectly correlated, have zeros in it. Values are L z of independent standard normal z, and the sources'
maps H (rows) act as the independent maps L^T H.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from irtscots_cl.calibration.consequences import OF_SURFACE
from irtscots_cl.calibration.measured import base_name
from irtscots_cl.calibration.parameters import zernike_noll
from irtscots_cl.maths.arrays import FloatArray
from irtscots_cl.scene.error_sources import Budget, Distribution
from irtscots_cl.scene.model import Scene
from irtscots_cl.scene.validation import SceneError, problem

NEGATIVE = 1e-6  # of the largest eigenvalue of correlations: rounding of a written covariance


@dataclass(frozen=True)
class Joint:
    """Sources of one normal distribution. names: [p]. root: [p, p], lower triangular, in their units."""

    names: tuple[str, ...] = ()
    root: FloatArray = field(default_factory=lambda: np.zeros((0, 0)), repr=False)

    @classmethod
    def of(cls, names: tuple[str, ...], covariance: FloatArray) -> Joint:
        """Raises ValueError for what is no covariance."""
        sigma = np.sqrt(np.diag(covariance))
        if not np.all(np.isfinite(covariance)) or not np.all(sigma > 0):
            raise ValueError("must have variances above 0")
        correlation = covariance / np.outer(sigma, sigma)
        values, vectors = np.linalg.eigh((correlation + correlation.T) / 2)
        if np.abs(correlation - correlation.T).max() > NEGATIVE or values[0] < -NEGATIVE * values[-1]:
            raise ValueError("must be symmetric and without negative variance in any direction")
        triangle = np.linalg.qr((vectors * np.sqrt(np.maximum(values, 0.0))).T, mode="r").T
        turned = triangle * np.where(np.diag(triangle) < 0, -1.0, 1.0)
        return cls(names, sigma[:, None] * turned)

    def values(self, normal: FloatArray) -> FloatArray:
        """Values [..., p] of independent standard normal numbers [..., p]."""
        found: FloatArray = normal @ self.root.T
        return found

    def independent(self, maps: FloatArray) -> FloatArray:
        """Maps [p, n] of independent standard normal numbers, of the sources' maps [p, n] per unit."""
        found: FloatArray = self.root.T @ maps
        return found


NONE = Joint()


def with_calibrated(budget: Budget, scene: Scene) -> tuple[Budget, Joint]:
    """The budget with the sources of its `calibrated` report, and their covariance.

    Only unknowns of the geometry are error sources: fitted figure terms are what the test finds. Raises SceneError.
    """
    if budget.calibrated is None:
        return budget, NONE
    path = budget.calibrated
    try:
        with open(path, encoding="utf-8") as file:
            found = _joint(json.load(file))
    except OSError as error:
        raise _refused(scene, path, f"not a readable file: {error.strerror}") from None
    except (KeyError, TypeError, IndexError, json.JSONDecodeError, UnicodeDecodeError):
        raise _refused(scene, path, "must be a report.json of `irtscots calibrate`") from None
    except ValueError as error:
        raise _refused(scene, path, f"its covariance {error}") from None
    for name in found.names:
        if name in budget.sources:
            text = "must be left out: budget.calibrated has its variance"
            raise problem(scene.name, ("budget", "sources", name), text)
    sigma = np.sqrt(np.sum(found.root**2, axis=1))
    added = {name: Distribution(normal=float(size)) for name, size in zip(found.names, sigma, strict=True)}
    return replace(budget, sources={**budget.sources, **added}), found


def _joint(report: dict[str, Any]) -> Joint:
    """Of the geometry of a report's first measurement. Raises KeyError and such for what is no report."""
    first = f" of {report['measurements'][0]['name']}"
    names = [str(unknown["name"]) for unknown in report["unknowns"]]
    covariance = np.array(report["covariance"], dtype=float)
    if covariance.shape != (len(names), len(names)):
        raise KeyError("covariance")
    use = [
        k for k, name in enumerate(names)
        if zernike_noll(base_name(name)) is None and base_name(name) not in OF_SURFACE
        and name in (base_name(name), base_name(name) + first)
    ]  # fmt: skip
    if not use:
        raise ValueError("must have an unknown of the geometry")
    return Joint.of(tuple(base_name(names[k]) for k in use), covariance[np.ix_(use, use)])


def _refused(scene: Scene, path: str, text: str) -> SceneError:
    return problem(scene.name, ("budget", "calibrated"), text, path)
