"""Which effects help: in which order and at which lengths of a record, and applied to other records."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import EffectPlace
from ..evidence.evidence import Evidence, Lengths, Model, Rerun, Sizes, largest_size, own_with, rms_size
from ..evidence.fit import ARCMIN, Fit, blocks_of, contains
from ..evidence.rows import Rows
from ..rounding import digits
from .cause import NamedEffect
from .result import CrossGain, Diagnosis, Helps, Length, OrderedEffect, OrderOfEffects, WithFound
from .search import search

MOST_STEPS, MOST_TRIED = 4, 12
HELPS = 0.02
"""Least part of the errors on left-out data that an effect of the order removes."""
SHOWN = 1.5
"""Errors of an effect that a length shows, with everything else refitted [bounds]."""


# In one record


def of_lengths(evidence: Evidence) -> Mapping[str, Any]:
    """Return the result keys of each scored length; empty for evidence without lengths.

    For a falsified model: its smallest sets of effects, and the order in which effects reduce the left-out errors, both
    for the corrected and for the measured errors.
    """
    lengths = evidence.reader.lengths
    if lengths is None:
        return {}
    of_parts = tuple(_length(evidence, lengths, k) for k in evidence.rows.scored)
    stable = is_stable([length.order for length in of_parts]) if evidence.model.falsified else None
    return {"lengths": of_parts, "order_stable": stable}


def _length(evidence: Evidence, lengths: Lengths, k: int) -> Length:
    """Return the result for one scored length."""
    part, rows = evidence.rows.parts[k], evidence.rows.select(k)
    alone = lengths.model_of(rows=rows)
    smallest: list[tuple[NamedEffect, ...]] = []
    order = order_as_measured = None
    if evidence.model.falsified:
        places = evidence.model.classes.places
        order = order_of_effects(rows, places)
        if lengths.as_measured is not None:
            order_as_measured = order_of_effects(lengths.as_measured.select(k), places)
        if alone.falsified:
            for fit in search(alone, places).fits:
                smallest.append(tuple(NamedEffect.of(place) for place in fit.places))
    if not (evidence.model.falsified and alone.falsified):
        smallest = [()]
    return Length(
        over=part.label,
        pieces=len(part),
        noise_bound_arcmin=float(np.median(part.bound)) / ARCMIN,
        rms_arcmin=rms_size(part.error) / ARCMIN,
        max_arcmin=largest_size(part.error) / ARCMIN,
        radius=alone.baseline.radius,
        smallest_sets=tuple(smallest),
        order=order,
        order_as_measured=order_as_measured,
    )


def order_of_effects(rows: Rows, places: Sequence[EffectPlace]) -> OrderOfEffects:
    """The order in which effects take most off the errors of the one scored part that were left out."""
    (scored,), folds = rows.scored, rows.folds()

    def rms_left_out(chosen: Sequence[EffectPlace]) -> float:
        return rms_size(rows.split(rows.left_out(chosen, folds))[scored])

    start = current = rms_left_out(())
    chosen: list[EffectPlace] = []
    steps = []
    while len(chosen) < min(len(places), MOST_STEPS):
        ranked = [(rms_left_out([*chosen, place]), place) for place in places if place not in chosen]
        ranked.sort(key=lambda entry: entry[0])
        best, place = _simplest_of_best(ranked)
        if best > (1.0 - HELPS) * current:
            break
        if len(ranked) > MOST_TRIED:
            # Only the effects that help most alone are tried beside the first.
            places = [tried_place for _, tried_place in ranked[:MOST_TRIED]] + chosen
        chosen.append(place)
        steps.append(OrderedEffect(**NamedEffect.keys(place), held_out_rms_arcmin=best / ARCMIN))
        current = best
    return OrderOfEffects(held_out_rms_arcmin=start / ARCMIN, steps=tuple(steps))


def _simplest_of_best(ranked: Sequence[tuple[float, EffectPlace]]) -> tuple[float, EffectPlace]:
    """Return the effect with the least remaining error, or a simpler, almost equal part of it, with that error."""
    least, first = ranked[0]
    for rms, place in ranked:
        if (1.0 - HELPS) * rms <= least and contains([first], [place]):
            return rms, place
    return least, first


def what_helps(evidence: Evidence, lengths: Sequence[Length]) -> tuple[tuple[EffectPlace, ...], tuple[str, ...]]:
    """Return the effects that reduce the left-out errors most at the middle length but do not make the model fit.

    The effects, and a sentence on them; nothing of evidence without lengths, or where nothing helps.
    """
    if not lengths:
        return (), ()
    middle = lengths[len(lengths) // 2]
    if (order := middle.order) is None or not order.steps:
        return (), ()
    places = tuple(step.place for step in order.steps)
    sentences = []
    for place, values in evidence.rows.values_of(places, evidence.rows.estimate(places)).items():
        names = (parameter.name for parameter in place.definition.parameters)
        sentences.append(place.definition.sentence(place, dict(zip(names, values, strict=True))))
    effects = " and ".join(step.effect for step in order.steps)
    text = (
        f"{effects}, though of all effects the most help: over {middle.over} the errors that were left out fall from "
        f"{digits(order.held_out_rms_arcmin)} to {digits(order.steps[-1].held_out_rms_arcmin)} arcmin rms, and not "
        f"within their bounds ({'; '.join(sentences)})"
    )
    lengths_of_reader = evidence.reader.lengths
    if lengths_of_reader is not None and (needed := lengths_of_reader.would_need(places)):
        text += f"; {needed}"
    return places, (text,)


def is_stable(orders: Sequence[OrderOfEffects | None]) -> bool:
    """Return true if all lengths begin with the same effect, and no two lengths order shared effects differently."""
    ordered = []
    for order in orders:
        if order is not None:
            ordered.append([step.place for step in order.steps])
    for first in ordered:
        for second in ordered:
            common = [place for place in first if place in second]
            if common != [place for place in second if place in first]:
                return False
    return len({tuple(order[:1]) for order in ordered}) <= 1


def only_at_one_length(evidence: Evidence, fit: Fit, lengths: Sequence[Length]) -> tuple[str, ...]:
    """Effects that one of several lengths needs at most, and that another one would show and does not: not named."""
    model_of = evidence.reader.lengths and evidence.reader.lengths.model_of
    if not lengths or model_of is None:
        return ()
    objections = []
    for place, block in zip(fit.places, fit.blocks, strict=True):
        if place not in evidence.rows.places:
            # For an effect with an onset, one length alone determines the time less well than the size.
            continue
        needing = [length.over for length in lengths if _needs(length, place)]
        if len(needing) > 1:
            continue
        columns, size = evidence.rows.numbers_of([place]), fit.central[len(fit.point) :][block]
        alone = evidence.rows.with_errors([part.columns[..., columns] @ size for part in evidence.rows.parts])
        remaining = [place_beside for place_beside in fit.places if place_beside != place]
        against = []
        for k, length in zip(evidence.rows.scored, lengths, strict=True):
            if length.over not in needing and model_of(rows=alone.select(k)).refit(remaining).radius > SHOWN:
                against.append(length.over)
        if against:
            needed = f"is needed over {needing[0]} alone" if needing else "is needed over no length by itself"
            objections.append(f"{place.title} {needed}; over {', '.join(against)} it would show and is not needed")
    return tuple(objections)


def _needs(length: Length, place: EffectPlace) -> bool:
    """Return true if an effect is in one of the smallest sets of a length."""
    needed: set[EffectPlace] = set()
    for effects in length.smallest_sets:
        needed.update(effect.place for effect in effects)
    return place in needed


# In other records


def found_in(diagnosis: Diagnosis) -> Sizes:
    """Linear effects that explain a record, or those that help most where nothing does, with the sizes stated."""
    evidence = diagnosis.evidence
    sizes: dict[EffectPlace, Floats] = {}
    if diagnosis.findings:
        fit = diagnosis.findings[0].fit
        for place, block, way in fit.ways:
            if way is None and place.effect != "outlier":
                sizes[place] = fit.stated[block]
    elif diagnosis.verdict == "unexplained":
        helpful, _ = what_helps(evidence, diagnosis.lengths or ())
        places = [place for place in helpful if place in evidence.rows.places]
        coefficients = evidence.rows.estimate(places)[len(evidence.rows.names) :]
        for place, block in zip(places, blocks_of(places), strict=True):
            sizes[place] = coefficients[block]
    return sizes


def cross_gains(alone: Mapping[str, Diagnosis]) -> tuple[tuple[CrossGain, ...], tuple[Helps, ...]]:
    """Return the errors of each record with the effects found in each, and where each effect helps."""
    evidence_of: dict[str, Evidence] = {}
    sources: dict[str, Sizes] = {}
    for label, diagnosis in alone.items():
        evidence = diagnosis.evidence
        if evidence.rows.names or evidence.rows.parts:
            evidence_of[label] = evidence
            if sizes := found_in(diagnosis):
                sources[label] = sizes
    gains, helps = [], []
    for label, evidence in evidence_of.items():
        rerun = evidence.reader.rerun
        if sources and rerun is not None and (before := rerun.errors({})) is not None:
            gains.append(_cross_gain(label, rerun, before, sources))
    for source, sizes in sources.items():
        for place in sizes:
            on = [label for label in evidence_of if label != source and _helps(evidence_of[label].model, sizes, place)]
            helps.append(Helps(found_in=source, effect=place.title, on=tuple(on)))
    return tuple(gains), tuple(helps) if len(evidence_of) > 1 else ()


def _cross_gain(label: str, rerun: Rerun, before: NDArray, sources: Mapping[str, Sizes]) -> CrossGain:
    """Return the errors of a record without effects (S, d), and with the effects found in each source."""
    over, unit, scale = rerun.quoted
    applied = []
    for source, sizes in sources.items():
        errors = rerun.errors(sizes)
        if errors is not None:
            applied.append(WithFound(found_in=source, **figures_of(errors, scale)))
    return CrossGain(record=label, over=over, unit=unit, **figures_of(before, scale), applied=tuple(applied))


def figures_of(error: NDArray, scale: float) -> dict[str, float]:
    """`rms` and `max` of the size of errors (S, d), quoted in a unit of this size."""
    return {"rms": rms_size(error) / scale, "max": largest_size(error) / scale}


def _helps(model: Model, sizes: Sizes, place: EffectPlace) -> bool:
    """Return true if an effect reduces a record's errors, alone or with those found beside it; to first order."""
    if place not in model.rows.linear_places:
        return False
    without = {effect: size for effect, size in sizes.items() if effect != place}
    for after, before in (({place: sizes[place]}, {}), (sizes, without)):
        if rms_with(model, after) < (1.0 - HELPS) * rms_with(model, before):
            return True
    return False


def rms_with(model: Model, effects: Sizes) -> float:
    """Root mean square of the errors over their bounds with effects of given coefficients, to first order."""
    places, sizes, point = own_with(model, effects)
    at = model.about(places, point, sizes)
    return float(np.sqrt(np.mean((at.residual / at.bound) ** 2)))
