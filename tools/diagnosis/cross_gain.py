"""What was found in one record, applied to others: how much it helps there by the extended FMUs."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..evidence.evidence import Evidence, largest_size, rms_size
from ..evidence.fit import blocks_of
from ..result import Result
from .cause import Number
from .order import HELPS, what_helps
from .result import Diagnosis

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
                **figures_of(before, scale),
                applied=tuple(WithFound(found_in=s, **figures_of(e, scale)) for s, e in applied if e is not None),
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


def figures_of(error: NDArray, scale: float) -> dict[str, float]:
    """`rms` and `max` of the size of errors (S, d), quoted in a unit of this size."""
    return {"rms": rms_size(error) / scale, "max": largest_size(error) / scale}


def _helps(evidence: Evidence, sizes: Sizes, place: EffectPlace) -> bool:
    """Whether an effect takes something off a record's errors, alone or beside those found with it; to first order."""
    if place not in evidence.linear_places:
        return False
    others = {other: size for other, size in sizes.items() if other != place}
    pairs = (({place: sizes[place]}, {}), (sizes, others))
    return any(evidence.rms_with(after) < (1.0 - HELPS) * evidence.rms_with(before) for after, before in pairs)
