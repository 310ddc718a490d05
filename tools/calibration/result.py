"""The result of a calibration: values with guaranteed errors; as JSON; as parameters of the components."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...fmus import version
from ..errors import InputError
from ..shown import Shown
from .linearisation import Linearisation
from .mountings import checked_rotation
from .reading_errors import ReadingError
from .values import (
    SCHEMA,
    block_parameters,
    calibrated_gravity,
    checked_calibration,
    target_estimates,
)

if TYPE_CHECKING:
    from polars import DataFrame

UNITS_OF_RESULT = {
    "noise_bound": "g",
    "gravity_mps2": "m/s2",
    "radius": "1",
    "parameters": "of estimate, guaranteed_error, low, high: as each says",
    "reading_errors": "g",
}
"""Units of the numbers of the published object; g is its own `gravity_mps2`."""


@dataclass(frozen=True)
class Estimate:
    """One target's value.

    Attributes
    ----------
    symbol, name, unit : str
        as the paper writes it, in words, and its unit
    estimate : float or None
        None where the measurements cannot determine it
    guaranteed_error : float or None
        a priori: σ times the l1 norm of the weights
    low, high : float or None
        the exact ends of what the measurements leave possible; None where they falsify the model
    """

    symbol: str
    name: str
    unit: str
    estimate: float | None
    guaranteed_error: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Provenance:
    """What a calibration was made from: the record's file and its SHA-256 (empty without a file), bounds of (1.7)."""

    record: str
    sha256: str
    bounds: tuple[float, float]


@dataclass(frozen=True)
class FeasibleSet:
    """What `trihedron.tools.calibration.estimates.feasible_set` needs: everything that the readings leave possible."""

    linearised: Linearisation
    centre: NDArray
    slack: float


@dataclass(frozen=True, repr=False)
class Calibration(Shown):
    """A calibration of the bench; `to_json` gives the published object.

    Attributes
    ----------
    verdict : str
        "consistent", "falsified" or "insufficient"
    noise_bound, noise_bound_basis
        σ as a fraction of g, and on what it rests
    gravity : float
        [m/s²]
    convention, baseline : str
        "A1" or "A2"; "asymmetric" or "symmetric"
    positions, measurements : int
        N and M
    radius : float
        least max |z − f(X)| / bound
    witness : tuple of (position, accelerometer)
        the measurements that prove a falsification, by the record's position numbers
    parameters : tuple of Estimate
    missing : tuple of Estimate
        those of `parameters` that the measurements cannot determine
    next_positions : tuple of dict
        table positions that would determine them
    warnings : tuple of str
    linearised : Linearisation
        the fit, for the diagnosis
    priors : tuple of (expression, limit)
        what was taken to be known beforehand
    reading_errors : tuple of ReadingError
        what the readings may be off by at the corners of the input
    provenance : Provenance or None
    feasible : FeasibleSet or None
        None where the measurements contradict the model
    """

    verdict: str
    noise_bound: float
    noise_bound_basis: str
    gravity: float
    convention: str
    baseline: str
    positions: int
    measurements: int
    radius: float
    witness: tuple[tuple[int, int], ...]
    parameters: tuple[Estimate, ...]
    missing: tuple[Estimate, ...]
    next_positions: tuple[dict[str, float | str], ...]
    warnings: tuple[str, ...]
    linearised: Linearisation
    priors: tuple[tuple[str, float], ...] = ()
    reading_errors: tuple[ReadingError, ...] = ()
    provenance: Provenance | None = None
    feasible: FeasibleSet | None = None

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.calibration/1, of plain lists, strings and numbers."""
        p = self.linearised.parametrisation
        content: dict[str, Any] = {
            "schema": SCHEMA,
            "verdict": self.verdict,
            "noise_bound": self.noise_bound,
            "noise_bound_basis": self.noise_bound_basis,
            "gravity_mps2": self.gravity,
            "convention": self.convention,
            "baseline": self.baseline,
            "mountings": {name: q.tolist() for name, q in zip(p.mountings, p.matrices, strict=True)},
            "positions": self.positions,
            "measurements": self.measurements,
            "radius": self.radius,
            "witness": [{"position": position, "accelerometer": axis} for position, axis in self.witness],
            "parameters": [dict(vars(estimate)) for estimate in self.parameters],
            "units": UNITS_OF_RESULT,
            "priors": [{"expression": expression, "limit": limit} for expression, limit in self.priors],
            "reading_errors": [
                {"accelerometer": e.accelerometer, "input": list(e.input), "low": e.low, "high": e.high}
                for e in self.reading_errors
            ],
        }
        if self.provenance is not None:
            content["provenance"] = {
                "trihedron": version(),
                "record": self.provenance.record,
                "record_sha256": self.provenance.sha256,
                "bounds": list(self.provenance.bounds),
            }
        if self.verdict == "insufficient":
            content["missing"] = [{"symbol": gap.symbol, "name": gap.name} for gap in self.missing]
            content["next_positions"] = [dict(position) for position in self.next_positions]
        content["warnings"] = list(self.warnings)
        return content

    def json_text(self) -> str:
        """`to_json` as text, one line for each key and each parameter."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"

    def lines(self) -> list[str]:
        """Verdict, table of targets, what it is worth."""
        from ..summaries import calibration_summary

        shown: Any = self
        return calibration_summary(shown).split("\n")

    def to_polars(self) -> "DataFrame":
        """A row for each target: symbol, name, unit, estimate, guaranteed_error, low, high."""
        import polars as pl

        numbers: Any = dict.fromkeys(("estimate", "guaranteed_error", "low", "high"), pl.Float64)
        return pl.DataFrame([vars(e) for e in self.parameters], schema_overrides=numbers)


def bench_parameters(calibration: Mapping[str, Any]) -> dict[str, dict[str, float | list[float]]]:
    """The parameters that make the simulated bench predict as it was calibrated.

    Δβ, α* and Δg cannot be told from other parameters: they are set to zero, and what they do stands in the others.

    Parameters
    ----------
    calibration : mapping
        a result with schema trihedron.calibration/1

    Returns
    -------
    dict
        component -> variable -> value, or list of values for an array

    Raises
    ------
    InputError
        for another schema, a result that is not consistent, or several mountings
    """
    where = "parameters_from"
    content = checked_calibration(calibration, where)
    mountings = content.get("mountings")
    if not isinstance(mountings, Mapping) or len(mountings) != 1:
        raise InputError(f"{where}: the calibration must have exactly one mounting to give parameters")
    (name, matrix), *_ = mountings.items()
    mounting = checked_rotation(matrix, f"{where}: mounting '{name}'")
    try:
        gravity = calibrated_gravity(content, where)
        return component_parameters(target_estimates(content, where), mounting, gravity)
    except KeyError as error:
        raise InputError(f"{where}: the calibration lacks {error.args[0]!r}") from error


def component_parameters(
    targets: Mapping[str, float], mounting: ArrayLike, gravity: float
) -> dict[str, dict[str, float | list[float]]]:
    """The components' parameters for given values of the 18 targets of case (A1).

    Parameters
    ----------
    targets : mapping
        symbol -> value, for every one of `trihedron.models.bench.TARGETS`
    mounting : (3, 3) array
        Q
    gravity : float
        the model's g [m/s²]

    Returns
    -------
    dict
        component -> variable -> value, or list of values for an array
    """
    return {
        "TurntableMotion": {
            "kappa": targets["X1"],
            "epsilon": targets["X3"],
            "alpha_offset": targets["X2"],
            "beta_offset": 0.0,
            "alpha_star": 0.0,
            "gravity": gravity,
            "gravity_error": 0.0,
            "mounting": np.asarray(mounting, dtype=float).ravel().tolist(),
            "mounting_error": [targets["X13"], targets["-X12"], targets["X8"]],
        },
        "AccelerometerBlock": block_parameters(targets, gravity),
        "AccelerometerCompensation": block_parameters(targets, gravity),
    }
