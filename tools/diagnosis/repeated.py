"""Repeatability: what each of several records by itself leaves possible of each parameter, and how much it changes."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Literal

from ..evidence.fit import Fit
from ..evidence.joint import Joint
from ..evidence.of_record import is_of_instrument
from ..result import Result, finite_or_none
from .cause import Number, SizedParameter, causes_of, centred, parameters_of
from .result import Diagnosis


class InOneRecord(Result):
    """What one record leaves possible of a parameter; None where it does not bound it, or no model stands."""

    record: str
    estimate: Number | None
    low: Number | None
    high: Number | None


class Repeated(Result):
    """A parameter, of the instrument or of an effect, from record to record, each by itself.

    Between two of the records it changes by `at_least` surely; over those with which a model stands by `at_most`, None
    where one leaves it open.
    """

    name: str
    unit: str
    of: Literal["instrument", "run"]
    records: tuple[InOneRecord, ...]
    at_least: Number
    at_most: Number | None


def repeated(
    alone: Mapping[str, Diagnosis], joint: Joint | None, places: Sequence[Any], *asked: Sequence[str]
) -> tuple[Repeated, ...]:
    """Parameters of the model and of shared effects from record to record, each record by itself.

    With the effects of `places` that act in it where it is judged with the others and stands with them, else with what
    explains it by itself, or with none. `asked` are names of what is shared, and of what is each record's own.
    """
    values: dict[tuple[str, str], dict[str, SizedParameter]] = {}
    for label, result in alone.items():
        evidence, fit = result.evidence, _standing(label, result, joint, places)
        for key in getattr(evidence, "names", ()):
            values.setdefault(key, {})
        if fit is None:
            continue
        found = [(p.name, p) for p in parameters_of(evidence, fit)]
        for cause in causes_of(evidence, fit):
            found += [(f"{cause.place.title}: {p.name}", p) for p in cause.parameters if cause.place in places]
        for name, parameter in found:
            values.setdefault((name, parameter.unit), {})[label] = parameter
    return tuple(repeated_of(*key, found, tuple(alone), *asked) for key, found in values.items())


def repeated_of(
    name: str,
    unit: str,
    found: Mapping[str, SizedParameter],
    labels: Sequence[str],
    shared: Sequence[str] = (),
    own: Sequence[str] = (),
) -> Repeated:
    """A parameter of which some of the records with these labels leave something; `shared`, `own` as for `join`."""
    ends = [found[label].ends if label in found else (-math.inf, math.inf) for label in labels]
    least = max(low for low, _ in ends) - min(high for _, high in ends)
    known = [found[label].ends for label in found]
    most = max((high for _, high in known), default=math.inf) - min((low for low, _ in known), default=0.0)
    return Repeated(
        name=name,
        unit=unit,
        of="instrument" if ": " in name or is_of_instrument(name, shared, own) else "run",
        records=tuple(
            InOneRecord(
                record=label,
                estimate=found[label].estimate if all(map(math.isfinite, pair)) else None,
                low=finite_or_none(pair[0]),
                high=finite_or_none(pair[1]),
            )
            for label, pair in zip(labels, ends, strict=True)
        ),
        at_least=max(0.0, least),
        at_most=finite_or_none(most),
    )


def _standing(label: str, result: Diagnosis, joint: Joint | None, places: Sequence[Any]) -> Fit | None:
    """The model with which a record stands by itself; None where none does, or several."""
    evidence = result.evidence
    if joint is not None and label in joint.labels:
        fit = joint.alone_with(joint.labels.index(label), places)
        if fit.radius <= evidence.limit:
            return centred(evidence, fit)
    if result.verdict == "explained":
        return result.findings[0].fit
    if result.verdict == "consistent":
        return centred(evidence, evidence.baseline)
    return None
