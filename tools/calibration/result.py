"""The result of a calibration: values with guaranteed errors; as JSON; as parameters of the components."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.mountings import checked_rotation
from trihedron.errors import InputError
from trihedron.models.bench import SYMMETRIC_PAIRS

SCHEMA = "trihedron.calibration/1"


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
class Calibration:
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
        }
        if self.verdict == "insufficient":
            content["missing"] = [{"symbol": gap.symbol, "name": gap.name} for gap in self.missing]
            content["next_positions"] = [dict(position) for position in self.next_positions]
        content["warnings"] = list(self.warnings)
        return content

    def json_text(self) -> str:
        """`to_json` as text, one line for each key and each parameter."""
        return json.dumps(self.to_json(), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


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
    if not isinstance(calibration, Mapping) or calibration.get("schema") != SCHEMA:
        found = calibration.get("schema") if isinstance(calibration, Mapping) else None
        raise InputError(f"parameters_from: the schema is {found!r}; a calibration has '{SCHEMA}'")
    if calibration.get("verdict") != "consistent":
        raise InputError(
            f"parameters_from: the calibration's verdict is {calibration.get('verdict')!r}; "
            "only a consistent one gives parameters"
        )
    mountings = calibration.get("mountings")
    if not isinstance(mountings, Mapping) or len(mountings) != 1:
        raise InputError("parameters_from: the calibration must have exactly one mounting to give parameters")
    (name, matrix), *_ = mountings.items()
    mounting = checked_rotation(matrix, f"parameters_from: mounting '{name}'")
    try:
        gravity = _number(calibration["gravity_mps2"], "gravity_mps2")
        value = {
            str(entry["symbol"]): _number(entry["estimate"], str(entry["symbol"]))
            for entry in calibration["parameters"]
            if entry["estimate"] is not None
        }
        if calibration.get("convention") == "A2":
            value |= {
                "X6+X8": 2 * value["(X6+X8)/2"],
                "X7+X12": 2 * value["(X7+X12)/2"],
                "X11+X13": 2 * value["(X11+X13)/2"],
                "X8": value["(X8-X6)/2"] + value["(X6+X8)/2"],
                "-X12": value["(X7-X12)/2"] - value["(X7+X12)/2"],
                "X13": value["(X13-X11)/2"] + value["(X11+X13)/2"],
            }
        if calibration.get("baseline") == "symmetric":
            value |= {minus: value[plus] for plus, minus in SYMMETRIC_PAIRS}
        return component_parameters(value, mounting, gravity)
    except KeyError as error:
        raise InputError(f"parameters_from: the calibration lacks {error.args[0]!r}") from error
    except TypeError as error:
        raise InputError("parameters_from: the calibration's parameters are not as its schema says") from error


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
        "AccelerometerBlock": {
            "gravity": gravity,
            "scale_error_plus": [targets["X4"], targets["X9"], targets["X14"]],
            "scale_error_minus": [targets["X5"], targets["X10"], targets["X15"]],
            "gamma_21": targets["X6+X8"],
            "gamma_31": targets["X7+X12"],
            "gamma_32": targets["X11+X13"],
            "gamma_12": 0.0,
            "gamma_13": 0.0,
            "gamma_23": 0.0,
            "bias": [targets["X16"], targets["X17"], targets["X18"]],
        },
    }


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6:
        raise InputError(f"parameters_from: {what} is {value!r}, not a number")
    return float(value)
