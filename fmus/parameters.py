"""Parameters of components from a calibration: as values, and as an SSP 1.0 parameter set that other tools read.

A calibration is the published object of schema trihedron.calibration/3; objects of former schemas are converted first.
Refusals are a ValueError without the name of the file, which the caller adds.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import isfinite, isnan, nan
from types import MappingProxyType
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import ArrayLike

from ..models.bench import BIAS, GYRO_PARAMETERS, MATRIX, SYMMETRIC_PAIRS, TARGETS, checked_rotation
from ..models.effects import CATALOGUE, EffectPlace
from .component import Component
from .units import Unit, base_unit, number_text, unit_named

CALIBRATION = "trihedron.calibration/3"
FIRST_SCHEMA, SECOND_SCHEMA = "trihedron.calibration/1", "trihedron.calibration/2"
JOINT_SCHEMA = "trihedron.joint-calibration/1"
CALIBRATIONS = (CALIBRATION, SECOND_SCHEMA, FIRST_SCHEMA, JOINT_SCHEMA)
"""Schemas of calibrations that can be read."""
RENAMED: dict[tuple[int | str, ...], tuple[int | str, ...]] = {
    ("noise_bound",): ("sigma", "value"),
    ("noise_bound_basis",): ("sigma", "from"),
}
"""Places of fields in the former schemas -> their places now."""
FURTHER_POSITIONS = "measure at its next_positions, or say by --prior what is known"
"""Remedy if an insufficient calibration lacks an estimate."""
GRAVITIES = (4.9, 14.7)
"""[m/s²]: half and one and a half times the standard, as readings are taken to be."""
CASES = {"convention": ("A1", "A2"), "baseline": ("asymmetric", "symmetric")}
BY_HAND = "by_hand"
"""Key of a calibration's facts that was made without a table's angles."""
BY_GRAVITY = {
    "gamma_11": ("X4", "X5"),
    "gamma_21": ("X6+X8",),
    "gamma_22": ("X9", "X10"),
    "gamma_31": ("X7+X12",),
    "gamma_32": ("X11+X13",),
    "gamma_33": ("X14", "X15"),
    "bias_1": ("X16",),
    "bias_2": ("X17",),
    "bias_3": ("X18",),
}
"""Symbols of a calibration by the size of gravity -> the same parameters of the bench."""

OF_SYMBOLS = {
    EffectPlace("gyro-g-sensitivity", "gyro-block"): tuple(f"S{row}{axis}" for row in (1, 2, 3) for axis in (1, 2, 3)),
    EffectPlace("latency", "gyro-block"): ("L",),
    **{EffectPlace("accelerometer-lag", f"accelerometer-{p}"): ("A",) for p in (1, 2, 3)},
    **{EffectPlace("lever-arm", f"accelerometer-{p}"): tuple(f"r{p}{axis}" for axis in (1, 2, 3)) for p in (1, 2, 3)},
}
"""Effects of instruments that are parameters of a calibration, and the symbols of these."""

VALUES = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
COMMON = "http://ssp-standard.org/SSP1/SystemStructureCommon"
INTERVAL = "trihedron.interval"
"""Type of the annotation that says which values of a parameter are possible."""
Interval = tuple[float | None, float | None]

Parameters = dict[str, float | list[float]]
"""Variable -> value in the variable's unit, or list of values for an array."""


def bench_parameters(calibration: Any) -> dict[str, Parameters]:
    """The parameters that make the simulated bench predict as it was calibrated, by component.

    They are the estimates, for any verdict. Δβ, α* and Δg cannot be told from other parameters: they are set to zero,
    and the others contain their effect. Without a table there are the instruments alone.

    Raises
    ------
    ValueError
        for another schema, a missing estimate, or several mountings
    """
    content = _one_calibration(calibration)
    if BY_HAND in content:
        block = calibrated_block(content)
        blocks = {"AccelerometerBlock": block, "AccelerometerCompensation": dict(block)}
        return blocks | _gyros(content, _gravity(content))
    mountings = content.get("mountings")
    if not isinstance(mountings, Mapping) or len(mountings) != 1:
        raise ValueError("the calibration must have exactly one mounting to give parameters")
    (name, matrix), *_ = mountings.items()
    try:
        mounting = checked_rotation(matrix)
    except ValueError as error:
        raise ValueError(f"mounting '{name}': {error}") from error
    with _complete(content.get("verdict")):
        gravity = _gravity(content)
        return component_parameters(target_estimates(content), gravity, mounting) | _gyros(content, gravity)


def component_parameters(targets: Mapping[str, float], gravity: float, mounting: ArrayLike) -> dict[str, Parameters]:
    """The components' parameters for given values of the 18 targets of case (A1), by component.

    Parameters
    ----------
    targets : mapping
        symbol -> value, for every one of `trihedron.models.bench.TARGETS`
    gravity : float
        the model's g [m/s²]
    mounting : (3, 3) array
        Q
    """
    table: Parameters = {
        "kappa": targets["X1"],
        "epsilon": targets["X3"],
        "alpha_offset": targets["X2"],
        "beta_offset": 0.0,
        "alpha_star": 0.0,
        "gravity": gravity,
        "gravity_error": 0.0,
        "mounting": np.asarray(mounting, dtype=float).ravel().tolist(),
        "mounting_error": [targets["X13"], targets["-X12"], targets["X8"]],
    }
    block = _block(targets, gravity)
    return {"TurntableMotion": table, "AccelerometerBlock": block, "AccelerometerCompensation": dict(block)}


def calibration_of(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a calibration's object in the present schema; any other object is returned as it is.

    Fields that are missing or wrong stay so: the validation of the object reports them.
    """
    schema = content.get("schema")
    if schema == JOINT_SCHEMA:
        return _of_joint_schema(content)
    if schema not in (FIRST_SCHEMA, SECOND_SCHEMA):
        return content
    former = ("noise_bound", "noise_bound_basis", "missing")
    present = _without(content, former)
    present |= {"schema": CALIBRATION, "sigma": _sigma(content)}
    if schema == FIRST_SCHEMA:
        present["estimator"] = "a priori"
    entries, gyros = content.get("parameters"), content.get("gyros")
    if isinstance(gyros, Mapping) and isinstance(entries, list) and isinstance(gyros.get("parameters"), list):
        entries = entries + gyros["parameters"]
        present["gyros"] = _without(gyros, ("parameters", "missing"))
    if isinstance(entries, list):
        present["parameters"] = [_of_former(entry, schema) for entry in entries]
        present["open"] = []
        for entry in present["parameters"]:
            if isinstance(entry, Mapping) and "symbol" in entry and not entry["determined"]:
                present["open"].append({"parameters": [entry["symbol"]]})
        if content.get("estimator", "") is None and len(present["open"]) < len(entries):
            present["estimator"] = "least squares"
    return present


def _sigma(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the bound of a former schema as σ."""
    basis = content.get("noise_bound_basis", "")
    kind = "unknown"
    if isinstance(basis, str):
        kind = {"given": "bound", "": "unknown"}.get(basis, "estimated")
    sigma = {"kind": kind, "from": basis}
    if "noise_bound" in content:
        return {"value": content["noise_bound"], **sigma}
    return sigma


def _of_former(entry: Any, schema: str) -> Any:
    """Return a target as it is written now; of the first schema, whose only estimate is the a-priori one."""
    if not isinstance(entry, Mapping):
        return entry
    if schema == FIRST_SCHEMA:
        entry = {"a_priori": entry.get("estimate"), **entry}
    present = {"determined": entry.get("a_priori") is not None, **entry}
    if schema != FIRST_SCHEMA and present.get("estimate", 0.0) is None:
        present["estimate"] = entry.get("least_squares")
    return present


def _of_joint_schema(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a calibration of several records as it is written now."""
    try:
        shared, of_record = [], {}
        for label, digest in zip(content["records"], content["sha256"], strict=True):
            former = {"noise_bound_basis": "", **content["of_records"][label]}
            kept = {key: former[key] for key in ("mountings", "reading_errors") if key in former}
            provenance = {"record": label, "record_sha256": digest}
            of_record[label] = {"sigma": _sigma(former), **kept, "parameters": [], "provenance": provenance}
        for entry in content.get("parameters", ()):
            symbol, label = entry["name"], entry["record"]
            present = _without(entry, ("record",))
            present |= {"symbol": symbol, "determined": entry["estimate"] is not None}
            if label is None:
                shared.append(present)
            else:
                of_record[label]["parameters"].append(present)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ValueError(f"the calibration of several records lacks {error.args[0]!r}; calibrate again") from error
    present = _without(content, ("records", "sha256", "of_records", "missing"))
    present |= {"schema": CALIBRATION, "sigma": {"value": None, "kind": "estimated", "from": "each record has its own"}}
    present |= {"parameters": shared, "of_record": of_record, "estimator": "analytic centre"}
    if content.get("verdict") == "falsified":
        present["estimator"] = None
    return present | {"open": [{"parameters": [name]} for name in content.get("missing", ())]}


def of_one_record(calibration: Any, sha256: str = "") -> Any:
    """Return a calibration of one record in the present schema; other objects unchanged.

    Of several records it is the one whose file has that SHA-256, else the last. A ValueError for one that is not as its
    schema says.
    """
    if not isinstance(calibration, Mapping):
        return calibration
    calibration = calibration_of(calibration)
    of_record = calibration.get("of_record")
    if not isinstance(of_record, Mapping) or not of_record:
        return calibration
    try:
        digests = {record["provenance"]["record_sha256"]: record for record in of_record.values()}
        last = list(of_record.values())[-1]
        record = digests.get(sha256, last) if sha256 else last
        parameters = [*calibration["parameters"], *record["parameters"]]
        return _without(calibration, ("of_record",)) | {**record, "parameters": parameters}
    except (KeyError, TypeError, IndexError, AttributeError) as error:
        raise ValueError(f"the calibration of several records lacks {error.args[0]!r}; calibrate again") from error


def calibrated_block(calibration: Any) -> Parameters:
    """Parameters of the block, and of its compensation; mountings do not matter.

    They are the estimates, for any verdict.

    Raises
    ------
    ValueError
        for an object that is not a calibration, or lacks an estimate
    """
    content = _one_calibration(calibration)
    with _complete(content.get("verdict")):
        return _block(target_estimates(content), _gravity(content))


def calibrated_elements(calibration: Any, key: str) -> dict[str, float | None]:
    """Another number of the block's scalars, as `gamma_21` or `bias[1]`: low, high or standard_error; None without.

    Raises
    ------
    ValueError
        for an object that is not a calibration, or lacks an estimate
    """
    content = _one_calibration(calibration)
    known: Mapping[str, float] = {}
    with suppress(KeyError):
        entries = []
        for entry in content["parameters"]:
            entries.append({"symbol": entry["symbol"], "estimate": entry.get(key)})
        known = target_estimates({**content, "parameters": entries})
    nothing = dict.fromkeys(TARGETS, nan)
    numbers = elements_of(_block(nothing | known, 0.0))
    elements: dict[str, float | None] = {}
    for name, value in elements_of(_block(nothing, 0.0)).items():
        if isnan(value):
            elements[name] = None if isnan(numbers[name]) else numbers[name]
    return elements


def calibrated_intervals(calibration: Any) -> dict[str, Interval]:
    """Least and largest possible values of the block's scalars, as `gamma_21` or `bias[1]`, that a calibration tells.

    Raises
    ------
    ValueError
        for an object that is not a calibration, or lacks an estimate
    """
    low, high = calibrated_elements(calibration, "low"), calibrated_elements(calibration, "high")
    return {name: (low[name], high[name]) for name in low}


def calibrated_gyros(calibration: Any) -> tuple[Parameters, dict[str, Interval]] | None:
    """Return the gyros' parameters and intervals of their scalars in a calibration; None without any.

    Raises
    ------
    ValueError
        for an object that is not a calibration by its schema
    """
    content = of_one_record(calibration)
    parameters = _gyros(content, 0.0)
    if not parameters:
        return None

    def side(end: str) -> dict[str, float]:
        entries = []
        for entry in content["parameters"]:
            value = entry.get(end)
            entries.append({**entry, "estimate": nan if value is None else value})
        values = {entry["symbol"]: entry["estimate"] for entry in entries}
        return elements_of(_gyro_block(values, 0.0))

    low, high = side("low"), side("high")
    gyro_parameters = _without(parameters["GyroBlock"], ("gravity",))
    return gyro_parameters, {name: (low[name], high[name]) for name in elements_of(gyro_parameters)}


def shown_effects(content: Mapping[str, Any]) -> dict[EffectPlace, list[Mapping[str, Any]]]:
    """Return the effects of `OF_SYMBOLS` that a calibration's object shows, with its entries of their parameters.

    On a bench the interval of one excludes zero. A negative lag of the accelerometers is one of the encoders.
    """
    parameters = {entry["symbol"]: entry for entry in content["parameters"]}
    effects = {}
    for place, symbols in OF_SYMBOLS.items():
        entries = [parameters[symbol] for symbol in symbols if parameters.get(symbol, {}).get("estimate") is not None]
        shown = content.get("by_hand") is not None or any(_excludes_zero(entry) for entry in entries)
        if shown and len(entries) == len(symbols) and (symbols != ("A",) or entries[0]["estimate"] > 0.0):
            effects[place] = entries
    return effects


def calibrated_effects(content: Mapping[str, Any]) -> dict[EffectPlace, tuple[list[float], list[Interval]]]:
    """Return all effects of components in a calibration's object with their sizes; of several explanations the first's.

    A ValueError for one that no component can have.
    """
    every: list[tuple[EffectPlace, Sequence[Mapping[str, Any]]]] = list(shown_effects(content).items())
    titles = {place.title: place for effect in CATALOGUE.values() for place in effect.places}
    # The estimates hold with the first explanation, and those of the others are zero.
    first = next(iter(content.get("sets") or ()), {}).get("effects")
    for effect in content.get("effects") or ():
        if first is not None and effect["effect"] not in first:
            continue
        place = titles.get(effect["effect"])
        if place is not None and place.effect == "outlier":
            continue
        if place is None or place.definition.component is None:
            raise ValueError(
                f"no component starts with {effect['effect']}; export the diagnosis (`diagnose --export`), or "
                "calibrate the rows before and after a break apart (--without)"
            )
        every.append((place, effect["parameters"]))
    sizes: dict[EffectPlace, tuple[list[float], list[Interval]]] = {}
    for place, entries in every:
        values, ends = sizes.setdefault(place, ([0.0] * len(entries), [(0.0, 0.0)] * len(entries)))
        for k, entry in enumerate(entries):
            values[k] += entry["estimate"]
            ends[k] = _sum(ends[k][0], entry.get("low")), _sum(ends[k][1], entry.get("high"))
    return sizes


def _sum(first: float | None, second: float | None) -> float | None:
    return None if first is None or second is None else first + second


def _excludes_zero(entry: Mapping[str, Any]) -> bool:
    """Return whether the interval of a parameter does not hold zero."""
    low, high = entry.get("low"), entry.get("high")
    return low is not None and high is not None and (low > 0.0 or high < 0.0)


def _without(content: Mapping[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """A copy without these keys."""
    return {key: value for key, value in content.items() if key not in keys}


def elements_of(values: Parameters) -> dict[str, float]:
    """Values of scalars by their names, `gamma_21` or `bias[1]`."""
    elements: dict[str, float] = {}
    for name, value in values.items():
        if isinstance(value, int | float):
            elements[name] = value
        else:
            for i, scalar in enumerate(value, 1):
                elements[f"{name}[{i}]"] = scalar
    return elements


def target_estimates(calibration: Mapping[str, Any]) -> dict[str, float]:
    """Return the estimates by the symbols of case (A1), for any convention and baseline of the calibration.

    They are the central ones; of the first schema the a-priori ones.

    Raises
    ------
    ValueError
        when an entry is not as its schema says
    KeyError
        for a combination that is needed and missing
    """
    value: dict[str, float] = {}
    a_priori = calibration.get("estimator") == "a priori"
    try:
        for entry in calibration["parameters"]:
            symbol = str(entry["symbol"])
            if symbol in value:
                raise ValueError(f"the calibration has {symbol} twice")
            if entry["estimate"] is not None:
                value[symbol] = checked_number(entry["estimate"], symbol)
                _check_interval(entry, value[symbol], symbol, a_priori=a_priori)
    except TypeError as error:
        raise ValueError("the calibration's parameters are not as its schema says") from error
    for symbol, targets in BY_GRAVITY.items():
        if symbol in value:
            value |= dict.fromkeys(targets, value[symbol])
    if calibration.get("convention") == "A2":
        value |= {name: 2 * value[f"({name})/2"] for name in ("X6+X8", "X7+X12", "X11+X13")}
        if "(X8-X6)/2" in value:
            value |= {
                "X8": value["(X8-X6)/2"] + value["(X6+X8)/2"],
                "-X12": value["(X7-X12)/2"] - value["(X7+X12)/2"],
                "X13": value["(X13-X11)/2"] + value["(X11+X13)/2"],
            }
    if calibration.get("baseline") == "symmetric":
        for _, minus in SYMMETRIC_PAIRS:
            if minus in value:
                raise ValueError(f"its baseline is symmetric, which has no {minus}; was it edited?")
        for plus, minus in SYMMETRIC_PAIRS:
            value[minus] = value[plus]
    return value


def gives_parameters(verdict: object, estimator: object) -> bool:
    """Return True if a calibration of this verdict and estimator gives parameters."""
    return verdict == "consistent" or (verdict == "noise-unknown" and estimator != "least squares")


def checked_number(value: Any, what: str) -> float:
    """Return the value if it is a number of a possible size; else raise a ValueError that begins with its name."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6:
        text = repr(value)
        raise ValueError(f"{what} is {text if len(text) <= 40 else text[:37] + '...'}, not a number")
    return float(value)


def _one_calibration(calibration: Any) -> Mapping[str, Any]:
    """The calibration, of several records that of the last, in the present schema; a ValueError for anything else."""
    calibration = of_one_record(calibration)
    if not isinstance(calibration, Mapping) or calibration.get("schema") != CALIBRATION:
        schema = calibration.get("schema") if isinstance(calibration, Mapping) else None
        raise ValueError(f"the schema is {schema!r}; a calibration has '{CALIBRATION}'")
    if BY_HAND in calibration:
        return calibration
    for key, values in CASES.items():
        if calibration.get(key) not in values:
            raise ValueError(f"its {key} is {calibration.get(key)!r}; it must be {' or '.join(values)}")
    return calibration


def _gravity(calibration: Mapping[str, Any]) -> float:
    gravity = checked_number(calibration["gravity_mps2"], "gravity_mps2")
    if not GRAVITIES[0] <= gravity <= GRAVITIES[1]:
        raise ValueError(f"gravity_mps2 is {gravity:g}; {GRAVITIES[0]:g} to {GRAVITIES[1]:g} is possible")
    return gravity


@contextmanager
def _complete(verdict: object = None) -> Iterator[None]:
    """Raise an error that names the missing key or target of a calibration, with the reason if its verdict has one."""
    try:
        yield
    except KeyError as error:
        mend = f"; {FURTHER_POSITIONS}" if verdict == "insufficient" else ""
        raise ValueError(f"the calibration lacks {error.args[0]!r}{mend}") from error


def _block(targets: Mapping[str, float], gravity: float) -> Parameters:
    """The block's parameters; X1, X2, X3, X8, -X12 and X13 are the bench's and the mounting's: not looked at."""
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


def _gyros(content: Mapping[str, Any], gravity: float) -> dict[str, Parameters]:
    """Return the parameters of gyros and of their compensation, where a calibration has them all."""
    known = known_values(content, (*GYRO_PARAMETERS[MATRIX], *GYRO_PARAMETERS[BIAS]))
    if known is None:
        return {}
    parameters = _gyro_block(known, gravity)
    return {"GyroBlock": parameters, "GyroCompensation": dict(parameters)}


def _gyro_block(values: Mapping[str, float], gravity: float) -> Parameters:
    """Return the parameters of gyros by the values of their symbols."""
    return {
        "gravity": gravity,
        "scale_misalignment": [values[symbol] for symbol in GYRO_PARAMETERS[MATRIX]],
        "bias": [values[symbol] for symbol in GYRO_PARAMETERS[BIAS]],
    }


def known_values(content: Mapping[str, Any], symbols: Iterable[str]) -> dict[str, float] | None:
    """Return the estimates of parameters by their symbols; None where one is missing.

    On a bench a parameter counts as missing where nothing bounds it. A ValueError for parameters that are not as the
    schema says.
    """
    known = {}
    try:
        for entry in content["parameters"]:
            if BY_HAND in content or entry.get("low") is not None:
                known[entry["symbol"]] = entry["estimate"]
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError("the calibration's parameters are not as its schema says") from error
    if any(known.get(symbol) is None for symbol in symbols):
        return None
    return {symbol: checked_number(known[symbol], symbol) for symbol in symbols}


def _check_interval(entry: Mapping[str, Any], estimate: float, symbol: str, *, a_priori: bool) -> None:
    """Refuse an estimate that its own interval excludes, an a-priori one by more than its guaranteed error.

    Where they are given.
    """
    keys, room, error = ["low", "high"], 0.0, ""
    if a_priori:
        keys.append("guaranteed_error")
    if any(entry.get(key) is None for key in keys):
        return
    ends = [checked_number(entry[key], f"{symbol}: {key}") for key in keys]
    low, high = ends[:2]
    if a_priori:
        room, error = ends[2] + 1e-9, "guaranteed error, "
    if not low <= high or estimate - room > high or estimate + room < low:
        raise ValueError(f"{symbol}: its estimate, {error}low and high exclude one another; was it edited?")


def parameter_set(
    component: Component,
    values: Mapping[str, float | list[float]],
    description: str,
    intervals: Mapping[str, Interval] | None = None,
) -> bytes:
    """The SSP 1.0 ParameterSet of some of a component's real parameters.

    Parameters
    ----------
    component : Component
        decides names, units and order
    values : mapping
        variable -> value in the variable's unit, or list of values for an array
    description : str
        where the values come from
    intervals : mapping, optional
        scalar, as `gamma_21` or `bias[1]`, -> least and largest possible value, None or infinite where nothing bounds
        it

    Returns
    -------
    bytes
        XML in UTF-8; the same values give the same bytes

    Raises
    ------
    ValueError
        for a name that is no real parameter of the component, or an array of another length
    """
    real_parameters = {}
    for variable in component.of("parameter"):
        if variable.type == "real":
            real_parameters[variable.name] = variable
    for name in values:
        if name not in real_parameters:
            raise ValueError(f"{component.name} has no real parameter {name}")
    rows: list[tuple[str, str, dict[str, str]]] = []
    units: dict[str, Unit] = {}
    for variable in real_parameters.values():
        if variable.name not in values:
            continue
        value = values[variable.name]
        if isinstance(value, list):
            scalars = value
        else:
            scalars = [value]
        if len(scalars) != len(variable.elements):
            raise ValueError(f"{variable.name} has {len(variable.elements)} elements, not {len(scalars)}")
        units[variable.unit] = unit_named(variable.unit)
        for name, scalar in zip(variable.elements, scalars, strict=True):
            rows.append((name, "Real", {"value": number_text(scalar), "unit": variable.unit}))
    return parameter_file(component.name, description, rows, units, intervals or {})


def parameter_file(
    name: str,
    description: str,
    values: Iterable[tuple[str, str, dict[str, str]]],
    units: Mapping[str, Unit],
    intervals: Mapping[str, Interval] = MappingProxyType({}),
    version: str = "1.0",
) -> bytes:
    """An .ssv of SSP; a value is its name, its type, and its text and unit as the attributes that hold them.

    The interval of a value stands in an annotation: an element `interval` with `low` and `high` in the value's unit; an
    end that nothing bounds is left out.
    """
    spaces = {"xmlns:ssv": VALUES, "xmlns:ssc": COMMON}
    root = Element("ssv:ParameterSet", {**spaces, "version": version, "name": name, "description": description})
    parameters = SubElement(root, "ssv:Parameters")
    for parameter, kind, attributes in values:
        element = SubElement(parameters, "ssv:Parameter", name=parameter)
        SubElement(element, f"ssv:{kind}", attributes)
        if parameter in intervals:
            ends = zip(("low", "high"), intervals[parameter], strict=True)
            bounded = {}
            for key, end in ends:
                if end is not None and isfinite(end):
                    bounded[key] = number_text(end)
            annotation = SubElement(SubElement(element, "ssv:Annotations"), "ssc:Annotation", type=INTERVAL)
            SubElement(annotation, "interval", bounded)
    add_units(root, "ssv:Units", units)
    return xml_bytes(root)


def add_units(parent: Element, name: str, units: Mapping[str, Unit]) -> None:
    """An element of SSP's units; nothing where there are none."""
    element = SubElement(parent, name) if units else parent
    for unit in sorted(units):
        SubElement(SubElement(element, "ssc:Unit", name=unit), "ssc:BaseUnit", base_unit(units[unit]))


def xml_bytes(root: Element) -> bytes:
    """XML in UTF-8; the same element gives the same bytes."""
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
