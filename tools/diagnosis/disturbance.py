"""The table disturbed by effects, and what signatures see of the bench there."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.effects import CATALOGUE, EffectPlace, Rows
from ..calibration.model import Linearisation, Positions, predicted_input, predicted_reading
from .circumstances import Circumstances
from .senses import input_senses


def acts_on_table(place: EffectPlace) -> bool:
    """Whether an effect turns parts of the table or adds to its encoders: then its turns are exact."""
    return CATALOGUE[place.effect].turns is not None


def acts_on_encoder(place: EffectPlace) -> bool:
    """Whether an effect adds to the readings of the encoders: then the true angles follow from it."""
    return CATALOGUE[place.effect].stage == "encoder_effects"


def is_linear(place: EffectPlace) -> bool:
    """Whether an effect is linear in its coefficients, so that its signature says it all."""
    return CATALOGUE[place.effect].variants is None


def coefficient_count(place: EffectPlace) -> int:
    """Number of linear coefficients of an effect: it has as many parameters."""
    return len(CATALOGUE[place.effect].at(place).parameters)


def small_turns(
    here: Linearisation,
    at: Positions,
    point: NDArray,
    chosen: Sequence[tuple[EffectPlace, NDArray]],
    circumstances: Circumstances,
) -> NDArray:
    """Turns (N, 4) [rad] that effects with these coefficients add to κ, about the outer axis, to ε, about the inner."""
    nothing = np.zeros((len(at.alpha), 3))
    rows = Rows(
        hours=circumstances.hours,
        alpha=at.alpha - point[here.symbols.index("X2")],
        beta=at.beta,
        n=nothing,
        by_alpha=nothing,
        by_beta=nothing,
        sense_alpha=circumstances.sense_alpha,
        sense_beta=circumstances.sense_beta,
    )
    turns = np.zeros((len(at.alpha), 4))
    for place, coefficients in chosen:
        function = CATALOGUE[place.effect].at(place).turns
        if function is not None:
            turns += function(place, rows) @ coefficients
    return turns


def with_coefficients(
    places: Sequence[EffectPlace], coefficients: NDArray, blocks: Sequence[slice]
) -> list[tuple[EffectPlace, NDArray]]:
    """Each effect with its part of the coefficients."""
    return [(place, coefficients[block]) for place, block in zip(places, blocks, strict=True)]


def true_angles(
    here: Linearisation,
    point: NDArray,
    places: Sequence[EffectPlace],
    coefficients: NDArray,
    blocks: Sequence[slice],
    circumstances: Circumstances,
) -> Positions:
    """Encoder readings [rad] freed from what effects add to them: the readings of faultless encoders."""
    at = here.positions
    chosen = [c for c in with_coefficients(places, coefficients, blocks) if acts_on_encoder(c[0])]
    there = at
    for _ in range(6 if chosen else 0):
        turns = small_turns(here, there, point, chosen, circumstances)
        there = replace(at, alpha=at.alpha + turns[:, 1], beta=at.beta + turns[:, 3])
    return there


def disturbed(
    here: Linearisation,
    point: NDArray,
    places: Sequence[EffectPlace],
    coefficients: NDArray,
    blocks: Sequence[slice],
    circumstances: Circumstances,
) -> Positions:
    """Where the table really stands: true angles, and the small turns of what gives way behind the encoders."""
    at = true_angles(here, point, places, coefficients, blocks, circumstances)
    chosen = [
        c for c in with_coefficients(places, coefficients, blocks) if acts_on_table(c[0]) and not acts_on_encoder(c[0])
    ]
    if not chosen:
        return at
    turns = small_turns(here, at, point, chosen, circumstances)
    return replace(at, alpha=at.alpha + turns[:, 1], beta=at.beta + turns[:, 3], tilts=turns[:, [0, 2]])


def rows_at(here: Linearisation, point: NDArray, at: Positions, circumstances: Circumstances) -> Rows:
    """What the signatures see at these positions; derivatives by a complex step."""
    p, step = here.parametrisation, 1e-30
    n = predicted_input(p, point, at)

    def slope(parameter: str | None, alpha: float = 0.0, beta: float = 0.0) -> NDArray:
        moved = point + 1j * step * np.array([symbol == parameter for symbol in p.symbols])
        there = replace(at, alpha=at.alpha + 1j * step * alpha, beta=at.beta + 1j * step * beta)
        return np.imag(predicted_reading(p, moved, there)) / step

    input_sense, sense_told = input_senses(p, point, at, circumstances)
    targets = (p.selection @ point)[at.mounting]
    plus, minus = (targets[:, [TARGETS.index(pair[k]) for pair in SYMMETRIC_PAIRS]] for k in (0, 1))
    return Rows(
        hours=circumstances.hours,
        alpha=at.alpha - point[here.symbols.index("X2")],
        beta=at.beta,
        n=n,
        by_alpha=slope(None, alpha=1.0),
        by_beta=slope(None, beta=1.0),
        by_kappa=slope("X1"),
        by_epsilon=slope("X3"),
        temperature=circumstances.temperature,
        sense_alpha=circumstances.sense_alpha,
        sense_beta=circumstances.sense_beta,
        input_sense=input_sense,
        sense_told=sense_told,
        own=n + np.where(n >= 0.0, plus, minus) * n,
        prediction=predicted_reading(p, point, at),
        temperature_resolution=circumstances.temperature_resolution,
        from_vertical=float(point[here.symbols.index("X2")]),
    )


def added_bound(
    places: Sequence[EffectPlace], rows: Rows, largest: Mapping[EffectPlace, float] | None = None
) -> NDArray:
    """By how much (3 N,) the bounds grow where the circumstances of linear effects are not told.

    Parameters
    ----------
    places : sequence of EffectPlace
        linear effects
    rows : Rows
    largest : mapping, optional
        the largest coefficient of such effects; by default the largest that the catalogue calls possible
    """
    added = np.zeros(rows.n.shape)
    for place in places:
        effect = CATALOGUE[place.effect].at(place)
        if effect.untold is not None:
            coefficient = (largest or {}).get(place, effect.parameters[0].largest)
            added += coefficient * effect.untold(place, rows)
    return added.ravel()


def signature_columns(places: Sequence[EffectPlace], rows: Rows) -> NDArray:
    """Signatures (3 N, K) of all effects, side by side."""
    columns = [CATALOGUE[place.effect].signature(place, rows).reshape(3 * len(rows.hours), -1) for place in places]
    return np.hstack(columns) if columns else np.zeros((3 * len(rows.hours), 0))
