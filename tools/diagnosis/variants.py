"""Effects that are not linear in their parameters: dead zone, saturation, quantisation, tried variant by variant."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.effects import CATALOGUE, EffectPlace, Rows
from ...models.effects.rows import Variant
from ..calibration.model import Linearisation, Positions, direction_jacobian, predicted_input
from .disturbance import added_bound, is_linear, signature_columns


@dataclass(frozen=True)
class Relaxation:
    """What any variant of an effect may do, and more: a set that is refused with it is refused with each of them.

    Attributes
    ----------
    place : EffectPlace
    ways : int
        number of variants; 0 of an effect that is linear, but not told everywhere
    touched : (M,) array of bool
        readings that some variant changes: they say nothing about the bench
    widening : (M,) array
        by which the bounds of the others grow, fractions of g
    columns : (M, K) array
        what the effect adds linearly
    """

    place: EffectPlace
    ways: int
    touched: NDArray
    widening: NDArray
    columns: NDArray


def variants_seen(place: EffectPlace, rows: Rows, reading: NDArray, sigma: float) -> list[Variant]:
    """The ways in which an effect can act on rows with readings (N, 3) and noise bound σ, fractions of g."""
    variants = CATALOGUE[place.effect].variants
    return [] if variants is None else variants(place, rows, reading, sigma)


def relaxations(here: Linearisation, rows: Rows, places: Sequence[EffectPlace]) -> list[Relaxation]:
    """Of each effect that can act on the record at all, what it may do at most."""
    found = []
    for place in places:
        if is_linear(place):
            columns = signature_columns([place], rows)
            found.append(Relaxation(place, 0, added_bound([place], rows) > 0.0, np.zeros(len(columns)), columns))
            continue
        variants = variants_seen(place, rows, here.reading, float(here.bound.min()))
        if not variants:
            continue
        touched = np.any([changed(variant) for variant in variants], axis=0)
        widening = np.max([variant.widening for variant in variants], axis=0)
        nothing = np.zeros((touched.size, 0))
        found.append(Relaxation(place, len(variants), touched.ravel(), widening.ravel(), nothing))
    return found


def changed(variant: Variant) -> NDArray:
    """Readings (N, 3) of bool that a variant changes."""
    return variant.lost | variant.fixed | (variant.offset != 0.0) | np.any(variant.columns != 0.0, axis=2)


def bench_slopes(here: Linearisation, point: NDArray, at: Positions, variant: Variant, slopes: NDArray) -> NDArray:
    """Derivatives (N, 3, P) of the readings by the bench's parameters, less what the effect does not let through."""
    if not variant.lost.any():
        return slopes
    p, left = here.parametrisation, slopes.copy()
    targets = (p.selection @ point)[at.mounting]
    inputs, n = direction_jacobian(p, point, at), predicted_input(p, point, at)
    for k, pair in enumerate(SYMMETRIC_PAIRS):
        rows = np.flatnonzero(variant.lost[:, k])
        chosen = np.where(here.sign[rows, k] >= 0, TARGETS.index(pair[0]), TARGETS.index(pair[1]))
        scale = 1.0 + targets[rows, chosen]
        by_scale = p.selection[at.mounting[rows], chosen]
        left[rows, k] -= scale[:, None] * inputs[rows, k] + n[rows, k][:, None] * by_scale
    return left
