"""Benches with one hidden effect: truth, effect and size, drawn from a seed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace
from ..models.effects.outlier import place_of
from .bounded.programmes import chebyshev_radius
from .calibration.model import Linearisation, Positions, linearise, parametrise
from .diagnosis.circumstances import Circumstances, senses_of
from .diagnosis.disturbance import coefficient_count, rows_at, signature_columns
from .errors import InputError, nearest

NOISE_BOUND = 1e-5
"""σ of the records: bound of the sum of the block's error and the encoders' fluctuation."""
STAND_BOUND, BLOCK_BOUND = 3e-3, 1e-2
"""The paper's bounds of the stand's and the block's errors."""
DWELL_S = 6.0
"""Rest at each position."""


@dataclass(frozen=True)
class HiddenCase:
    """A bench with its secret.

    Attributes
    ----------
    truth : dict
        component -> variable -> value
    place : EffectPlace or None
        the hidden effect; None for a clean record
    values : tuple of float
        its parameters
    alpha, beta : (N,) array
        commanded angles [rad]
    """

    truth: dict[str, dict[str, Any]]
    place: EffectPlace | None
    values: tuple[float, ...]
    alpha: NDArray
    beta: NDArray

    def answer(self) -> dict[str, Any]:
        """The secret, for whoever wants to compare."""
        if self.place is None:
            return {"effect": None}
        names = [parameter.name for parameter in CATALOGUE[self.place.effect].at(self.place).parameters]
        entry: dict[str, Any] = {"effect": self.place.effect, "where": self.place.where}
        if self.place.order is not None:
            entry["order"] = self.place.order
        if self.place.effect == "outlier":
            entry["accelerometer"] = self.place.axes[0]
        elif self.place.axes:
            entry["axes"] = list(self.place.axes)
        return {**entry, "parameters": dict(zip(names, self.values, strict=True))}


def bench_positions() -> tuple[NDArray, NDArray]:
    """Commanded angles [rad] of 40 positions: 24 with all signs certain, 16 between them.

    The extra ones share no angle: harmonics of the encoders that look alike at equal steps of 45 degrees differ there.
    """
    pairs = [(20 + 45 * k, beta) for k in range(8) for beta in (25, 145, 265)]
    pairs += [((13 + 67 * k) % 360, (33 + 101 * k) % 360) for k in range(16)]
    angles = np.radians(np.array(pairs, dtype=float))
    return angles[:, 0], angles[:, 1]


def draw_truth(rng: np.random.Generator, *, symmetric: bool) -> dict[str, dict[str, Any]]:
    """Parameters of table and block, uniform within the paper's bounds."""

    def uniform(bound: float, size: int | None = None) -> Any:
        value = rng.uniform(-bound, bound, size)
        return value.tolist() if size else float(value)

    plus = uniform(BLOCK_BOUND / 2, 3)
    return {
        "TurntableMotion": {
            "kappa": uniform(STAND_BOUND),
            "epsilon": uniform(STAND_BOUND),
            "alpha_offset": uniform(STAND_BOUND / 2),
            "alpha_star": uniform(STAND_BOUND / 2),
            "beta_offset": uniform(STAND_BOUND / 2),
            "gravity_error": uniform(BLOCK_BOUND / 10),
            "mounting_error": uniform(STAND_BOUND, 3),
        },
        "AccelerometerBlock": {
            "scale_error_plus": plus,
            "scale_error_minus": plus if symmetric else uniform(BLOCK_BOUND / 2, 3),
            "gamma_21": uniform(BLOCK_BOUND / 2),
            "gamma_31": uniform(BLOCK_BOUND / 2),
            "gamma_32": uniform(BLOCK_BOUND / 2),
            "bias": uniform(BLOCK_BOUND, 3),
        },
    }


def faultless_bench(alpha: NDArray, beta: NDArray, *, symmetric: bool) -> Linearisation:
    """The model linearised at a faultless bench at some positions."""
    p = parametrise({"identity": np.eye(3)}, symmetric=symmetric)
    at = Positions(alpha, beta, np.zeros(len(alpha), dtype=int))
    point = np.zeros(len(p.symbols))
    return linearise(p, at, np.zeros((len(alpha), 3)), point, np.full(3 * len(alpha), NOISE_BOUND))


def temperature_at(hours: NDArray) -> NDArray:
    """Temperature of the laboratory [degC]: it swings by 4 K, once in ten minutes, so that it is unlike the time."""
    return 20.0 + 4.0 * np.sin(2.0 * math.pi * 6.0 * hours)


def expected_circumstances(alpha: NDArray, beta: NDArray) -> Circumstances:
    """What the rows will depend on beside their angles, about as the bench will run."""
    hours = np.arange(len(alpha)) * (DWELL_S + 4.0) / 3600.0
    return Circumstances(hours, temperature_at(hours), senses_of(alpha), senses_of(beta), True)


def sure_size(here: Linearisation, circumstances: Circumstances, place: EffectPlace, direction: NDArray) -> float:
    """Size of an effect, along a direction (K,) of its coefficients, from which it is surely detected: 2 σ / distance.

    The distance is that of the unit effect from all that the nominal model can say, in the maximum norm.
    """
    rows = rows_at(here, here.point, here.positions, circumstances)
    unit = signature_columns([place], rows) @ direction
    radius, _, _ = chebyshev_radius(here.jacobian, unit, np.ones(len(unit)))
    return 2.0 * NOISE_BOUND / radius if radius > 1e-9 else math.inf


def visible_places(here: Linearisation, circumstances: Circumstances, baseline: str) -> list[EffectPlace]:
    """Where linear effects show in the readings at these positions and in these circumstances."""
    rows = rows_at(here, here.point, here.positions, circumstances)
    basis, _ = np.linalg.qr(here.jacobian)
    found = []
    for effect in POSITION_EFFECTS.values():
        for place in effect.places if effect.within != baseline and effect.variants is None else ():
            columns = signature_columns([place], rows)
            if np.linalg.norm(columns - basis @ (basis.T @ columns)) > 1e-9:
                found.append(place)
    return found


def draw_case(seed: int, *, effects: Sequence[str] | None = None, symmetric: bool = False) -> HiddenCase:
    """Draw truth, effect and size.

    Parameters
    ----------
    seed : int
        the same seed gives the same case
    effects : sequence of str, optional
        names to draw from; an empty one gives a clean record; by default every effect that the baseline lacks
    symmetric : bool
        the block's scale factors do not depend on the sign

    Raises
    ------
    InputError
        an unknown name
    """
    rng = np.random.default_rng(seed)
    truth = draw_truth(rng, symmetric=symmetric)
    alpha, beta = bench_positions()
    order = rng.permutation(len(alpha))
    alpha, beta = alpha[order], beta[order]
    baseline = "symmetric" if symmetric else "asymmetric"
    here = faultless_bench(alpha, beta, symmetric=symmetric)
    circumstances = expected_circumstances(alpha, beta)
    visible = visible_places(here, circumstances, baseline)
    usable = [
        e.name for e in POSITION_EFFECTS.values() if e.name == "outlier" or any(p.effect == e.name for p in visible)
    ]
    for name in effects or ():
        if name not in usable:
            raise InputError(f"--effect {name}: not one that can be hidden here; {nearest(name, usable)}")
    names = usable if effects is None else list(effects)
    if not names:
        return HiddenCase(truth, None, (), alpha, beta)
    name = names[rng.integers(len(names))]
    if name == "outlier":
        place = place_of(int(rng.integers(len(alpha))) + 1, int(rng.integers(3)) + 1)
    else:
        places = [place for place in visible if place.effect == name]
        place = places[rng.integers(len(places))]
    count = coefficient_count(place)
    direction = rng.normal(size=count)
    direction /= np.linalg.norm(direction)
    if CATALOGUE[name].at(place).parameters[0].smallest == 0.0 and count == 1:
        direction = np.abs(direction)
    size = rng.uniform(3.0, 6.0) * sure_size(here, circumstances, place, direction)
    effect = CATALOGUE[name].at(place)
    largest = effect.parameters[0].largest
    values = effect.from_coefficients(min(size, largest) * direction)
    return HiddenCase(truth, place, values, alpha, beta)
