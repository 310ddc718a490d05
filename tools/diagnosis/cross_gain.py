"""What was found in one record, applied to others: how much it helps there by the extended FMUs, or taken out."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from ...models.effects import EffectPlace
from ..errors import InputError
from ..evidence.evidence import Evidence, largest_size, rms_size
from ..evidence.fit import blocks_of
from ..files import LARGEST_RESULT, bytes_of
from ..records import PositionRecord, StrapdownRecord
from ..result import Result, Told, field_problems
from .cause import Cause, Number
from .order import HELPS, what_helps
from .result import DIAGNOSIS, FIRST_DIAGNOSIS, Diagnosis

Sizes = Mapping[EffectPlace, NDArray[np.float64]]
"""Effects with their linear coefficients."""


class WithFound(Result):
    """Errors with what was found in one record."""

    found_in: str
    rms: Number
    max: Number


class CrossGain(Result):
    """Errors of one record, simulated by FMUs: `rms` and `max` without effects, and with what was found in each record.

    `over` says of what the errors are; `unit` is "arcmin" or "g". What is a record's own, its biases, is fitted to it.
    """

    record: str
    over: str
    unit: str
    rms: Number
    max: Number
    applied: tuple[WithFound, ...]


class Helps(Result):
    """An effect that was found in a record: other records on which it helps, alone or with the others found there.

    On none: it is the run's.
    """

    found_in: str
    effect: str
    on: tuple[str, ...]


def found_in(result: Diagnosis) -> Sizes:
    """Linear effects that explain a record, or those that help most where nothing does, with the sizes stated."""
    evidence = result.evidence
    if result.findings:
        fit = result.findings[0].fit
        return {place: fit.stated[block] for place, block, way in fit.ways if way is None and place.effect != "outlier"}
    if result.verdict != "unexplained":
        return {}
    places = [place for place in what_helps(evidence, result.lengths or ())[0] if place in evidence.places]
    found = evidence.estimate(places)[len(evidence.names) :]
    return {place: found[block] for place, block in zip(places, blocks_of(places), strict=True)}


def cross_gains(alone: Mapping[str, Diagnosis]) -> tuple[tuple[CrossGain, ...], tuple[Helps, ...]]:
    """The matrix of errors of records, with what was found in each; and where each of these effects helps."""
    known = {
        label: result.evidence for label, result in alone.items() if result.evidence.names or result.evidence.parts
    }
    sources = {label: sizes for label in known if (sizes := found_in(alone[label]))}
    gains = []
    for label, evidence in known.items() if sources else ():
        if (before := evidence.applied({})) is None:
            continue
        over, unit, scale = evidence.quoted_errors
        applied = [(source, evidence.applied(sizes)) for source, sizes in sources.items()]
        gains.append(
            CrossGain(
                record=label,
                over=over,
                unit=unit,
                **_figures(before, scale),
                applied=tuple(WithFound(found_in=s, **_figures(e, scale)) for s, e in applied if e is not None),
            )
        )
    helps = [
        Helps(
            found_in=source,
            effect=place.title,
            on=tuple(label for label in known if label != source and _helps(known[label], sizes, place)),
        )
        for source, sizes in sources.items()
        for place in sizes
    ]
    return tuple(gains), tuple(helps) if len(known) > 1 else ()


def _figures(error: NDArray, scale: float) -> dict[str, float]:
    return {"rms": rms_size(error) / scale, "max": largest_size(error) / scale}


def _helps(evidence: Evidence, sizes: Sizes, place: EffectPlace) -> bool:
    """Whether an effect takes something off a record's errors, alone or beside those found with it; to first order."""
    if place not in evidence.linear_places:
        return False
    others = {other: size for other, size in sizes.items() if other != place}
    pairs = (({place: sizes[place]}, {}), (sizes, others))
    return any(evidence.rms_with(after) < (1.0 - HELPS) * evidence.rms_with(before) for after, before in pairs)


class AppliedEffect(Result):
    """An effect that was found, and what became of it in another record.

    "corrected": what it adds was taken out of the readings; "simulated": the extended FMUs have it, but no inverse;
    "left": it does not show in a record of this kind, or is not linear in its sizes.
    """

    effect: str
    how: Literal["corrected", "simulated", "left"]


class Applied(Told):
    """Another record with what was found in one.

    Errors are of the simulation of the record by FMUs, without and with the effects, over what `over` says, in `unit`;
    None where nothing can be run. What is the record's own, its biases, is fitted to it in both. `record` is the record
    with what could be taken out.
    """

    schema_: Literal["trihedron.applied/1"] = Field(default="trihedron.applied/1", alias="schema")
    rows: int
    effects: tuple[AppliedEffect, ...]
    over: str | None = None
    unit: str | None = None
    rms_without: Number | None = None
    rms_with: Number | None = None
    max_without: Number | None = None
    max_with: Number | None = None
    warnings: tuple[str, ...] = ()

    record: Any = Field(default=None, exclude=True)


def read_diagnosis(path: Path) -> Diagnosis | None:
    """The diagnosis that a file holds; None where it is something else. An InputError where it is not as its schema."""
    try:
        content = json.loads(bytes_of(path, most=LARGEST_RESULT).decode("utf-8"))
        if not isinstance(content, dict) or content.get("schema") not in (DIAGNOSIS, FIRST_DIAGNOSIS):
            return None
        return Diagnosis.model_validate_json(json.dumps(content))
    except ValidationError as error:
        raise InputError(f"{path}: {field_problems(error, Diagnosis)[0][1]}") from error
    except (ValueError, RecursionError):
        return None


def coefficients_of(cause: Cause) -> NDArray[np.float64]:
    """Linear coefficients (K,) of a cause: of an amplitude and its phase those of cosine and sine."""
    values, found = list(cause.values), []
    for parameter, value, after in zip(cause.parameters, values, [*values[1:], 0.0], strict=True):
        if parameter.name.endswith("amplitude"):
            found += [value * np.cos(after), value * np.sin(after)]
        elif not parameter.name.endswith("phase"):
            found.append(value)
    return np.array(found)


def applied_to(found: Diagnosis, record: PositionRecord | StrapdownRecord, evidence: Evidence) -> Applied:
    """What a diagnosis names, applied to another record, whose evidence is given.

    An InputError for a diagnosis that names nothing, or a record that cannot be run.
    """
    if found.verdict != "explained":
        raise InputError(f"the diagnosis is {found.verdict}: it names nothing that could be applied")
    if missing := evidence.missing():
        raise InputError(f"{record.path}: cannot be run: {'; '.join(map(str, missing.get('missing', ())))}")
    places = {c.place: c for c in found.causes if c.place in evidence.linear_places}
    sizes = {place: coefficients_of(cause) for place, cause in places.items()}
    corrected, readings = evidence.without_added(sizes)
    effects = tuple(
        AppliedEffect(
            effect=cause.place.title,
            how="corrected" if cause.place in corrected else "simulated" if cause.place in sizes else "left",
        )
        for cause in found.causes
    )
    told: dict[str, Any] = {"rows": len(record), "warnings": tuple(record.warnings)}
    before, after = (evidence.applied(those) for those in ({}, sizes)) if sizes else (None, None)
    if before is not None and after is not None:
        over, unit, scale = evidence.quoted_errors
        told |= {"over": over, "unit": unit}
        for name, error in (("without", before), ("with", after)):
            told |= {f"{key}_{name}": value for key, value in _figures(error, scale).items()}
    return Applied(effects=effects, record=replace(record, **readings) if corrected else None, **told)
