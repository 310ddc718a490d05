"""Diagnoses of the schemas before, as they are written now.

Missing or wrong fields stay as they are: the validation of the object reports them.
"""

from collections.abc import Mapping
from typing import Any

from ..calibration.targets import NAMES

FIRST, SECOND, SEVERAL = "trihedron.diagnosis/1", "trihedron.diagnosis/2", "trihedron.several/1"
FORMER = (FIRST, SECOND, SEVERAL)
DIAGNOSIS = "trihedron.diagnosis/3"
OF_BASELINE = ("noise_bound", "noise_bound_basis", "noise_bound_from", "baseline")
OF_SETS = ("extended", "extension", "alternatives")
OF_SEVERAL = {"gains": "cross_gain", "witnesses": "judgement"}
"""Keys of several records that have another name now."""
EACH_ITS_OWN_SIGMA = {"value": None, "kind": "unknown", "from": "each record has its own"}


def of_former_schemas(content: Mapping[str, Any]) -> dict[str, Any]:
    """A diagnosis of one record, or of several, in the present schema; any other object as it is.

    `sets` are the causes of the sets that it names, or that remain, each with a radius and a calibration, `extension`
    what extends the model: of these explanations are made.
    """
    schema = content.get("schema")
    if schema in (FIRST, SECOND):
        return _of_one(content)
    return _of_several(content) if schema == SEVERAL else dict(content)


def _of_one(content: Mapping[str, Any]) -> dict[str, Any]:
    baseline = content.get("baseline")
    present = {key: value for key, value in content.items() if key not in (*OF_BASELINE, *OF_SETS)}
    present["schema"] = DIAGNOSIS
    if not isinstance(baseline, Mapping):
        return {**present, "calibration": baseline}
    basis = content.get("noise_bound_basis", content.get("noise_bound_from", ""))
    kind = {"given": "bound", "": "unknown"}.get(str(basis), "estimated")
    sigma = {"value": content.get("noise_bound"), "kind": kind, "from": basis}
    parameters = _parameters(baseline.get("parameters"))
    explained = content.get("verdict") == "explained"
    present["calibration"] = _calibration(content, baseline.get("radius"), sigma, [] if explained else parameters)
    present["calibration"]["witness"] = baseline.get("witness") or []
    extended = content.get("extended")
    radius = extended.get("radius") if isinstance(extended, Mapping) else None
    calibration = {**_calibration({}, radius, sigma, _targets(content.get("targets")) + parameters)}
    _add_sets(present, content, radius, calibration if explained else None)
    if content.get("extension") is not None:
        present["extension"] = content["extension"]
    return present


def _of_several(content: Mapping[str, Any]) -> dict[str, Any]:
    dropped = ("radius", "radius_with_causes", "parameters", "alternatives", *OF_SEVERAL)
    present = {key: value for key, value in content.items() if key not in dropped}
    for former, name in OF_SEVERAL.items():
        present[name] = content.get(former, [])
    sigma = EACH_ITS_OWN_SIGMA
    parameters = _parameters(content.get("parameters"))
    has_causes = bool(content.get("causes"))
    present |= {"schema": DIAGNOSIS, "baseline_model": "shared parameters"}
    present["calibration"] = _calibration(content, content.get("radius"), sigma, [] if has_causes else parameters)
    present["repeatability"] = _each_by_itself(content.get("repeatability"), content.get("records"))
    radius = content.get("radius_with_causes")
    sets = {"verdict": content.get("verdict"), "causes": _causes(content.get("causes"))}
    sets["alternatives"] = [_causes(causes) for causes in content.get("alternatives") or ()]
    _add_sets(present, sets, radius, _calibration({}, radius, sigma, parameters))
    return present


def _add_sets(
    present: dict[str, Any], content: Mapping[str, Any], radius: Any, calibration: Mapping[str, Any] | None
) -> None:
    """Sort the causes into those that are named and those that remain."""
    causes, alternatives = content.get("causes") or [], content.get("alternatives") or []
    explained = content.get("verdict") == "explained"
    present["causes"] = causes if explained else []
    present["sets"] = [(causes, radius, calibration)] if causes else []
    if isinstance(alternatives, list):
        present["sets"] += [(causes_of_set, None, None) for causes_of_set in alternatives]
    if not explained:
        present["alternatives"] = [causes_of_set for causes_of_set, *_ in present["sets"]]


def _calibration(content: Mapping[str, Any], radius: Any, sigma: Mapping[str, Any], parameters: Any) -> dict[str, Any]:
    """Return the calibration of a diagnosis with this verdict; of a model that fits without one."""
    verdict = {"insufficient": "insufficient", "consistent": "consistent"}.get(str(content.get("verdict")), "falsified")
    return {
        "schema": "trihedron.calibration/3",
        "verdict": verdict if content else "consistent",
        "sigma": sigma,
        "radius": radius,
        "estimator": None,
        "parameters": parameters,
    }


def _each_by_itself(former: Any, records: Any) -> Any:
    """Return repeatability as a calibration: each record alone, and the changes."""
    if not isinstance(former, list) or not isinstance(records, list):
        return former
    of_record = {}
    for entry in records:
        if isinstance(entry, Mapping):
            label = entry.get("record")
            of_record[label] = {"sigma": EACH_ITS_OWN_SIGMA, "parameters": [], "provenance": {"record": label}}
    changes = []
    for entry in former:
        if not isinstance(entry, Mapping):
            return former
        words = {"symbol": entry.get("name"), "name": entry.get("name"), "unit": entry.get("unit")}
        for alone in entry.get("records") or ():
            bounded = isinstance(alone, Mapping) and (alone.get("low"), alone.get("high")) != (None, None)
            if bounded and alone.get("record") in of_record:
                values = {key: alone.get(key) for key in ("estimate", "low", "high")}
                determined = {"determined": values["estimate"] is not None}
                of_record[alone["record"]]["parameters"].append(words | determined | values)
        change = {key: entry.get(key) for key in ("unit", "of", "at_least", "at_most")}
        changes.append({"symbol": entry.get("name"), **change, "since": None, "beside": None})
    present = _calibration({}, None, EACH_ITS_OWN_SIGMA, [])
    return {**present, "of_record": of_record, "changes": changes}


def _entries(former: Any) -> list[Any]:
    """Return the entries of a list, or an empty list for any other object."""
    return former if isinstance(former, list) else []


def _parameters(former: Any) -> list[Any]:
    """Parameters with name, unit, estimate and ends, as a calibration has them."""
    parameters = []
    for entry in _entries(former):
        if not isinstance(entry, Mapping):
            parameters.append(entry)
            continue
        bounded = entry.get("low") is not None and entry.get("high") is not None
        parameters.append({"symbol": entry.get("name"), "determined": bounded, **entry})
    return parameters


def _targets(former: Any) -> list[Any]:
    """Return targets next to the effects in the form of a calibration."""
    parameters = []
    for entry in _entries(former):
        if isinstance(entry, Mapping):
            values = {"estimate": entry.get("after"), "low": entry.get("low"), "high": entry.get("high")}
            symbol = str(entry.get("symbol"))
            words = {"name": symbol, "unit": NAMES.get(symbol.partition("@")[0], ("", "1"))[1]}
            parameters += _parameters([{**words, **values}])
    return parameters


def _causes(former: Any) -> list[Any]:
    """Causes of several records: an effect, or a shared parameter that differs, and the one record in which it acts.

    Their equivalents were written by title alone, and are left out.
    """
    causes = []
    for entry in _entries(former):
        if not isinstance(entry, Mapping):
            causes.append(entry)
            continue
        effect = entry.get("effect")
        if not isinstance(effect, Mapping):
            effect = {"effect": "parameter", "where": entry.get("parameter")}
        cause = {**effect, "equivalents": [], "parameters": entry.get("parameters")}
        if entry.get("record") is not None:
            cause["record"] = entry["record"]
        causes.append(cause)
    return causes
