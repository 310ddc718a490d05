"""The bench model together with a set of effects: readings and derivatives at one point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace, Rows
from ...models.effects.rows import Variant
from ..calibration.model import Linearisation, predicted_reading, reading_jacobian
from .circumstances import Circumstances
from .disturbance import acts_on_table, added_bound, disturbed, rows_at, signature_columns
from .variants import bench_slopes, variants_seen


@dataclass(frozen=True)
class ExtendedModel:
    """Prediction and derivatives at one point.

    Attributes
    ----------
    reading, bound : (3 N,) array
        predicted readings and bounds of their errors, fractions of g
    jacobian : (3 N, P + K) array
        derivatives by parameters of the bench and coefficients of the effects
    variants : tuple of (Variant or None)
        the way in which each effect acts that is not linear
    rows : Rows
        the rows with this prediction
    """

    reading: NDArray
    jacobian: NDArray
    bound: NDArray
    variants: tuple[Variant | None, ...]
    rows: Rows


def coefficient_blocks(places: Sequence[EffectPlace], variants: Sequence[Variant | None]) -> tuple[slice, ...]:
    """The coefficients of each effect, one effect after the other."""
    blocks, first = [], 0
    for place, variant in zip(places, variants, strict=True):
        count = len(CATALOGUE[place.effect].at(place).parameters) if variant is None else variant.columns.shape[2]
        blocks.append(slice(first, first + count))
        first += count
    return tuple(blocks)


def extended_model(
    here: Linearisation,
    point: NDArray,
    places: Sequence[EffectPlace],
    coefficients: NDArray,
    circumstances: Circumstances,
) -> tuple[NDArray, NDArray]:
    """Predicted readings (3 N,) over g with linear effects, and their derivatives (3 N, P + K) there."""
    blocks = coefficient_blocks(places, [None] * len(places))
    model = model_at(here, point, places, coefficients, blocks, circumstances, {}, 0.0, {})
    if model is None:
        raise ValueError("linear effects act in one way only")
    return model.reading, model.jacobian


def model_at(
    here: Linearisation,
    point: NDArray,
    places: Sequence[EffectPlace],
    coefficients: NDArray,
    blocks: Sequence[slice],
    circumstances: Circumstances,
    ways: Mapping[EffectPlace, int],
    resolution: float,
    largest: Mapping[EffectPlace, float],
) -> ExtendedModel | None:
    """The model with the effects of `fit_ways` at a point; None where one of their ways is none there."""
    linear = [(place, coefficients[block]) for place, block in zip(places, blocks, strict=True) if place not in ways]
    own = np.concatenate([c for _, c in linear]) if linear else np.zeros(0)
    named = [place for place, _ in linear]
    pieces = coefficient_blocks(named, [None] * len(named))
    at = disturbed(here, point, named, own, pieces, circumstances)
    rows = replace(rows_at(here, point, at, circumstances), resolution=resolution)
    columns = {place: signature_columns([place], rows) for place, _ in linear}
    reading = predicted_reading(here.parametrisation, point, at, here.sign).ravel()
    for place, part in linear:
        if not acts_on_table(place):
            reading = reading + columns[place] @ part
    slopes = reading_jacobian(here.parametrisation, point, at, here.sign)
    rows = replace(rows, prediction=reading.reshape(-1, 3))
    bound = here.bound + added_bound(named, rows, largest)
    chosen: dict[EffectPlace, Variant] = {}
    fixed = np.zeros(rows.n.shape, dtype=bool)
    for place, way in ways.items():
        variant = acting(place, way, rows, here)
        if variant is None:
            return None
        chosen[place] = variant
        slopes = bench_slopes(here, point, at, variant, slopes)
        reading = reading + variant.offset.ravel()
        bound = bound + variant.widening.ravel()
        columns[place] = variant.columns.reshape(len(reading), -1)
        fixed |= variant.fixed
    slopes[fixed] = 0.0
    for place, block in zip(places, blocks, strict=True):
        if place in ways:
            reading = reading + columns[place] @ coefficients[block]
        else:
            columns[place][fixed.ravel()] = 0.0
    jacobian = np.hstack([slopes.reshape(len(reading), -1), *(columns[place] for place in places)])
    return ExtendedModel(reading, jacobian, bound, tuple(chosen.get(place) for place in places), rows)


def acting(place: EffectPlace, way: int, rows: Rows, here: Linearisation) -> Variant | None:
    """One of the ways in which an effect can act on these rows; None where there are fewer."""
    seen = variants_seen(place, rows, here.reading, float(here.bound.min()))
    return seen[way] if way < len(seen) else None
