"""Positions at which effects that the model does not hold would show.

A unit effect changes the readings by d. No parameters imitate it better than to dist = min over X of max |d − F'X|;
noise within σ cannot hide an effect larger than 2 σ / dist. Near the optimal positions some effects are nearly
parameters.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace, Rows
from ...models.regressors import nominal_input, stand_regressors
from ..bounded.programmes import chebyshev_radius
from ..errors import InputError, nearest
from .places import Places, Readings, Task, allowed, readings

LATTICE_DEG = 15.0
PHASES = 8
"""An effect with two coefficients is judged by the least distance over so many phases."""
SHORTLIST = 10
"""So many positions, those where the effects show most, are judged by the distance itself."""
NOTHING = 1e-9


@dataclass(frozen=True)
class Detection:
    """How well effects show.

    Attributes
    ----------
    effects : tuple of EffectPlace
    before, after, most : (E,) array
        distance of the unit effect from the model's range: with the plan, with the extra positions, and with every
        position of the lattice
    """

    effects: tuple[EffectPlace, ...]
    before: NDArray
    after: NDArray
    most: NDArray


def named_effects(names: Sequence[str]) -> list[EffectPlace]:
    """The effects that a person names: "quadratic accelerometer-3", or "quadratic" for all its places.

    Raises
    ------
    InputError
        for a name that is not in the catalogue
    """
    places = {place.title: place for effect in POSITION_EFFECTS.values() for place in effect.places}
    found: list[EffectPlace] = []
    for name in names:
        words = " ".join(name.split())
        if words in POSITION_EFFECTS and not CATALOGUE[words].places:
            raise InputError(f"--detect {name!r}: is of one reading; no choice of positions shows it better")
        own = [place for title, place in places.items() if title == words or place.effect == words]
        if not own:
            effect = words.split(" ")[0]
            known = (
                [t for t in places if t.split(" ")[0] == effect]
                if effect in POSITION_EFFECTS
                else list(POSITION_EFFECTS)
            )
            raise InputError(f"--detect {name!r}: is not in the catalogue; {nearest(words, known)}")
        found += [place for place in own if place not in found]
    return found


def _rows(task: Task, places: Places) -> Rows:
    alpha, beta = places.angle.T
    matrix = task.parametrisation.matrices[places.mounting]
    stand = stand_regressors(alpha, beta, matrix)
    turn = np.stack([np.sin(alpha) * np.cos(beta), -np.sin(alpha) * np.sin(beta), np.zeros(len(places))], axis=1)
    return Rows(
        hours=np.zeros(len(places)),
        alpha=alpha,
        beta=beta,
        n=nominal_input(alpha, beta, matrix),
        by_alpha=-stand[..., 1],
        by_beta=np.squeeze(matrix @ turn[..., None], -1),
        by_kappa=stand[..., 0],
        by_epsilon=stand[..., 2],
        temperature=np.full(len(places), 20.0),
    )


def _columns(task: Task, effect: EffectPlace, places: Places, given: Readings) -> NDArray:
    """What the unit effect adds to the readings that count (M, K)."""
    entry = CATALOGUE[effect.effect].at(effect)
    columns = np.zeros((len(places), 3, 1))
    if entry.variants is None:
        columns = entry.signature(effect, _rows(task, places)).reshape(len(places), 3, -1)
    if not columns.any():
        raise InputError(
            f"--detect {effect.title!r}: is not linear, or shows in time, temperature or moves, not by positions alone"
        )
    return columns[given.position, task.accelerometer[given.sheet]]


def distance(task: Task, effect: EffectPlace, places: Places) -> float:
    """Chebyshev distance of the unit effect from the range of the model on the readings of these positions."""
    given = readings(task, places)
    columns = _columns(task, effect, places, given)
    return min(_distance(given.regressor, columns @ unit)[0] for unit in _units(columns.shape[1]))


def _units(count: int) -> list[NDArray]:
    if count == 2:
        phases = np.pi * np.arange(PHASES) / PHASES
        return [np.array([np.cos(phase), np.sin(phase)]) for phase in phases]
    return list(np.eye(count))


def _distance(regressor: NDArray, signal: NDArray) -> tuple[float, NDArray]:
    size = float(np.abs(signal).max(initial=0.0))
    if size < NOTHING:
        return 0.0, np.zeros(regressor.shape[1])
    radius, x, _ = chebyshev_radius(regressor, signal / size, np.ones(len(signal)))
    return (radius if radius > 1e-8 else 0.0) * size, x * size


def detecting(task: Task, places: Places, effects: Sequence[EffectPlace], extra: int) -> tuple[Places, Detection]:
    """Add positions, one by one, that raise the least distance relative to what the whole lattice would give.

    Parameters
    ----------
    places : Places
        the plan
    effects : sequence of EffectPlace
    extra : int
        how many positions are added, at most: none that help nothing

    Returns
    -------
    Places
        the plan with the extra positions at its end
    Detection

    Raises
    ------
    InputError
        for an effect that does not depend on the positions
    """
    lattice = _lattice(task)
    whole = Places(np.concatenate([places.angle, lattice.angle]), np.concatenate([places.mounting, lattice.mounting]))
    most = np.array([distance(task, effect, whole) for effect in effects])
    before = np.array([distance(task, effect, places) for effect in effects])
    for effect, limit in zip(effects, most, strict=True):
        if limit <= NOTHING:
            raise InputError(f"--detect {effect.title!r}: is imitated by the parameters at every position")
    here, now = places, before
    for _ in range(extra):
        weakest = int((now / most).argmin())
        if now[weakest] > 0.999 * most[weakest]:
            break
        trials = [_joined(here, lattice.chosen([row])) for row in _promising(task, effects[weakest], here, lattice)]
        judged = [np.array([distance(task, effect, trial) for effect in effects]) for trial in trials]
        worth = [(round(float((d / most).min()), 9), round(float((d / most).mean()), 9)) for d in judged]
        pick = max(range(len(trials)), key=lambda k: worth[k])
        here, now = trials[pick], judged[pick]
    return here, Detection(tuple(effects), before, now, most)


def _joined(one: Places, other: Places) -> Places:
    return Places(np.concatenate([one.angle, other.angle]), np.concatenate([one.mounting, other.mounting]))


def _lattice(task: Task) -> Places:
    degrees = np.arange(0.0, 360.0, LATTICE_DEG)
    angle = np.radians(np.stack(np.meshgrid(degrees, degrees, indexing="ij"), axis=-1).reshape(-1, 2))
    angle = angle[allowed(task, angle)]
    mountings = len(task.parametrisation.mountings)
    places = Places(np.concatenate([angle] * mountings), np.repeat(np.arange(mountings), len(angle)))
    return places.chosen(np.unique(readings(task, places).position))


def _promising(task: Task, effect: EffectPlace, here: Places, lattice: Places) -> NDArray:
    """Positions of the lattice where the parameters that imitate the effect best on the plan fail most."""
    given, there = readings(task, here), readings(task, lattice)
    columns, beyond = _columns(task, effect, here, given), _columns(task, effect, lattice, there)
    units = _units(columns.shape[1])
    solved = [_distance(given.regressor, columns @ unit) for unit in units]
    weakest = min(range(len(units)), key=lambda k: solved[k][0])
    missed = np.abs(beyond @ units[weakest] - there.regressor @ solved[weakest][1])
    highest = np.zeros(len(lattice))
    np.maximum.at(highest, there.position, missed)
    return np.argsort(-np.round(highest, 9), kind="stable")[:SHORTLIST]
