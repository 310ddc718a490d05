"""Values of a calibration's file, checked: what components, parameter sets and corrections are made from."""

from collections.abc import Mapping
from typing import Any

from ...models.bench import SYMMETRIC_PAIRS
from ..errors import InputError

SCHEMA = "trihedron.calibration/1"
GRAVITIES = (4.9, 14.7)
"""[m/s²]: half and one and a half times the standard, as readings are taken to be."""


def checked_calibration(calibration: Any, where: str) -> Mapping[str, Any]:
    """The calibration, when it is a consistent one.

    Parameters
    ----------
    calibration : object
        what was read
    where : str
        what messages begin with

    Raises
    ------
    InputError
        for another schema, or a verdict that is not consistent
    """
    if not isinstance(calibration, Mapping) or calibration.get("schema") != SCHEMA:
        found = calibration.get("schema") if isinstance(calibration, Mapping) else None
        raise InputError(f"{where}: the schema is {found!r}; a calibration has '{SCHEMA}'")
    verdict = calibration.get("verdict")
    if verdict != "consistent":
        raise InputError(f"{where}: the calibration's verdict is {verdict!r}; only a consistent one gives parameters")
    for key, known in (("convention", ("A1", "A2")), ("baseline", ("asymmetric", "symmetric"))):
        if calibration.get(key) not in known:
            raise InputError(f"{where}: its {key} is {calibration.get(key)!r}; it must be {' or '.join(known)}")
    return calibration


def target_estimates(calibration: Mapping[str, Any], where: str) -> dict[str, float]:
    """Estimates by the symbols of case (A1), whatever the calibration's convention and baseline.

    Raises
    ------
    InputError
        when an entry is not as its schema says
    KeyError
        for a combination that is needed and missing
    """
    value: dict[str, float] = {}
    try:
        for entry in calibration["parameters"]:
            symbol = str(entry["symbol"])
            if symbol in value:
                raise InputError(f"{where}: the calibration has {symbol} twice")
            if entry["estimate"] is not None:
                value[symbol] = number(entry["estimate"], f"{where}: {symbol}")
                _check_interval(entry, value[symbol], f"{where}: {symbol}")
    except TypeError as error:
        raise InputError(f"{where}: the calibration's parameters are not as its schema says") from error
    if calibration.get("convention") == "A2":
        value |= {whole: 2 * value[f"({whole})/2"] for whole in ("X6+X8", "X7+X12", "X11+X13")}
        if "(X8-X6)/2" in value:
            value |= {
                "X8": value["(X8-X6)/2"] + value["(X6+X8)/2"],
                "-X12": value["(X7-X12)/2"] - value["(X7+X12)/2"],
                "X13": value["(X13-X11)/2"] + value["(X11+X13)/2"],
            }
    if calibration.get("baseline") == "symmetric":
        if doubled := [minus for _, minus in SYMMETRIC_PAIRS if minus in value]:
            raise InputError(f"{where}: its baseline is symmetric, which has no {doubled[0]}; was it edited?")
        value |= {minus: value[plus] for plus, minus in SYMMETRIC_PAIRS}
    return value


def block_parameters(targets: Mapping[str, float], gravity: float) -> dict[str, float | list[float]]:
    """Parameters of the block, and of its compensation, variable -> value, for values of the targets of case (A1).

    X1, X2, X3, X8, -X12 and X13 are the bench's and the mounting's: they are not looked at.
    """
    return {
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
    }


def calibrated_block(calibration: Any, where: str) -> dict[str, float | list[float]]:
    """`block_parameters` of a calibration's object; mountings do not matter.

    Raises
    ------
    InputError
        for what is no consistent calibration
    """
    content = checked_calibration(calibration, where)
    try:
        return block_parameters(target_estimates(content, where), calibrated_gravity(content, where))
    except KeyError as error:
        raise InputError(f"{where}: the calibration lacks {error.args[0]!r}") from error


def calibrated_gravity(calibration: Mapping[str, Any], where: str) -> float:
    """The g [m/s²] of a calibration's object; a KeyError without it, an InputError when there is none such on Earth."""
    gravity = number(calibration["gravity_mps2"], f"{where}: gravity_mps2")
    if not GRAVITIES[0] <= gravity <= GRAVITIES[1]:
        raise InputError(f"{where}: gravity_mps2 is {gravity:g}; {GRAVITIES[0]:g} to {GRAVITIES[1]:g} is possible")
    return gravity


def _check_interval(entry: Mapping[str, Any], estimate: float, what: str) -> None:
    """Refuse an estimate that its own interval and guaranteed error exclude; where they are given."""
    ends = [entry.get(key) for key in ("low", "high", "guaranteed_error")]
    if any(end is None for end in ends):
        return
    low, high, error = (number(end, f"{what}: {key}") for end, key in zip(ends, ("low", "high", "error"), strict=True))
    room = error + 1e-9
    if not low <= high or estimate - room > high or estimate + room < low:
        raise InputError(f"{what}: its estimate, guaranteed error, low and high exclude one another; was it edited?")


def number(value: Any, what: str) -> float:
    """The value, when it is a number of a possible size; else an InputError that begins with what it is."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6:
        shown = repr(value)
        raise InputError(f"{what} is {shown if len(shown) <= 40 else shown[:37] + '...'}, not a number")
    return float(value)
