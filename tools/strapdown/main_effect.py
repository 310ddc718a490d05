"""The system about one large effect: the simulation is run with it, so that its second order is in the errors.

Signatures are of first order. Where one effect makes nearly all of errors that are many times their bounds, its second
order may be above them too. The errors are then those of a run with the effect, and what it does to first order is
added again: as if it acted linearly.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from .building import Built, with_parameters
from .carrying import GyroModel, carried_attitude
from .gain import effects_of
from .gravity_system import GravityPieces, directions_of, move_errors, small_turns
from .inspection import Inspection
from .norm_calibration import NAMES
from .signatures import turned
from .system import System, weighted_step
from .truth_system import window_errors

MANY = 4.0
"""Errors of so many bounds, root mean square over that of noise at its bound, may hold a second order that counts."""
MOST_OF_IT = 3.0
"""By so much an effect must lower the errors."""


def about_main_effect(found: Inspection, built: Built) -> Built:
    """The record's system about the effect that makes most of its errors; as it is where none does."""
    even = system_of_one_bound(built.system)
    place = main_effect(even)
    if place is None:
        return built
    solution = weighted_step(even.matrix([place]), even.residual)
    parameters = CATALOGUE[place.effect].at(place).parameters
    values = effects_of(even.names, [place], solution)[place]
    if not all(p.possible(v) for p, v in zip(parameters, values, strict=True)):
        return built
    return about_effects(found, built, [place], solution)


def about_effects(found: Inspection, built: Built, places: Sequence[EffectPlace], solution: NDArray) -> Built:
    """The system about effects of the gyros of such sizes: the second order of their run is in the errors.

    Parameters
    ----------
    found : Inspection
    built : Built
    places : sequence of EffectPlace
    solution : (P + k,) array
        steps of the baseline's parameters and the effects' coefficients
    """
    system = built.system
    step, size = solution[: len(system.names)], solution[len(system.names) :]
    gyros = with_parameters(built.model, built.own, step[len(NAMES) if built.forces else 0 :])
    bias = gyros.bias
    if built.at_rest is not None:
        bias = bias - built.at_rest[:, system.numbers_of(places)] @ size
    model = GyroModel(bias, gyros.scale_misalignment, effects_of(system.names, places, solution))
    attitude = carried_attitude(built.motion, model, found.gravity)
    columns = np.concatenate([np.arange(len(system.names)), len(system.names) + system.numbers_of(places)])
    parts = []
    for part, error in zip(system.parts, errors_of(found, built, attitude, step), strict=True):
        linear = np.concatenate([part.nominal, part.columns], axis=-1)[..., columns] @ solution
        parts.append(part if error is None else replace(part, error=error + linear))
    return replace(built, system=replace(system, parts=tuple(parts)))


def system_of_one_bound(system: System) -> System:
    """The system with a median bound where a part has none."""
    if all((part.bound > 0.0).all() for part in system.parts):
        return system
    least = float(np.median(np.abs(system.parts[0].error))) + 1e-12
    return replace(system, parts=tuple(replace(p, bound=np.maximum(p.bound, least)) for p in system.parts))


def main_effect(system: System) -> EffectPlace | None:
    """The gyros' effect that alone makes most of large errors; None where there is none."""
    before = left_after(system, None)
    if not before > MANY / np.sqrt(3.0):
        return None
    gyros = [p for p in system.places if CATALOGUE[p.effect].component in ("GyroBlock", "AttitudeComputer")]
    left = {place: left_after(system, place) for place in gyros}
    best = min(left, key=lambda place: left[place], default=None)
    return best if best is not None and MOST_OF_IT * left[best] < before else None


def left_after(system: System, place: EffectPlace | None) -> float:
    """Root mean square of what least squares leaves, in bounds."""
    matrix = system.matrix([] if place is None else [place])
    left = system.residual - matrix @ weighted_step(matrix, system.residual) if matrix.shape[1] else system.residual
    return float(np.sqrt(np.mean(left**2)))


def errors_of(found: Inspection, built: Built, attitude: NDArray, step: NDArray) -> list[NDArray[np.float64] | None]:
    """Errors of each part with another attitude and steps of the baseline's parameters; None: they stay."""
    if not isinstance(built.pieces, GravityPieces):
        assert found.record.attitude is not None
        truth = found.record.attitude
        return [window_errors(windows, truth, attitude) for windows in built.pieces]
    pieces = built.pieces
    point = built.system.point[: len(NAMES)]
    first = directions_of(point, found.rests, found.gravity, {})
    up = directions_of(point + step[: len(NAMES)], found.rests, found.gravity, {})
    moved = iter(
        move_errors(turned(moves, attitude), up[ends[:, 0]], up[ends[:, 1]], first[ends[:, 0]])
        for moves, ends in zip(pieces.moves, pieces.ends, strict=True)
    )
    errors: list[NDArray[np.float64] | None] = []
    for part in built.system.parts:
        kind = part.segments.kind
        if kind == "norms":
            errors.append(None)
        else:
            errors.append(next(moved) if kind == "moves" else small_turns(turned(pieces.rests, attitude)))
    return errors
