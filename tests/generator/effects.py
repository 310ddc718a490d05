"""Changes of the readings of a table's positions by effects of the catalogue, by independent definitions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

Numbers = Sequence[float]
Sized = tuple[Any, Numbers]
"""A place, with `effect`, `where`, `order` and `axes` as the product names them, and the sizes of the parameters."""


@dataclass(frozen=True)
class Visits:
    """N positions as an effect sees them: true angles (N, 2) [rad], inputs (N, 3) [g], hours, temperature, senses."""

    angles: np.ndarray
    n: np.ndarray
    hours: np.ndarray
    temperature: np.ndarray
    senses: np.ndarray

    @property
    def alpha(self) -> np.ndarray:
        """True outer angles (N,) [rad]."""
        return self.angles[:, 0]

    @property
    def beta(self) -> np.ndarray:
        """True inner angles (N,) [rad]."""
        return self.angles[:, 1]


def _changed_sign(n: np.ndarray) -> np.ndarray:
    """Return the sense (N,) of the last change of an input, from zero at first."""
    return np.sign(np.diff(n, prepend=0.0))


def lagged(hours: np.ndarray, temperature: np.ndarray, constant: float) -> np.ndarray:
    """Return the temperature (N,) behind a lag of first order [h], settled at the first row; linear between the
    rows."""
    late = np.array(temperature)
    for k in range(1, len(late)):
        step = hours[k] - hours[k - 1]
        slope = (temperature[k] - temperature[k - 1]) / step
        steady = temperature[k - 1] - slope * constant
        late[k] = steady + (late[k - 1] - steady) * np.exp(-step / constant) + slope * step
    return late


def of_powers(temperature: np.ndarray, sizes: Numbers) -> np.ndarray:
    """Return a polynomial (N,) without constant of the temperature above 20 °C, in tens of kelvins."""
    return np.polynomial.polynomial.polyval((temperature - 20.0) / 10.0, [0.0, *sizes])


Law = Callable[[Visits, np.ndarray, Numbers, Sequence[int]], np.ndarray]
"""Visits, the accelerometer's own input (N,), sizes, axes from 1 -> addition (N,) [g]."""
LAWS: dict[str, Law] = {
    "scale-asymmetry": lambda v, x, s, _: s[0] * np.abs(x),
    "bias-asymmetry": lambda v, x, s, _: s[0] * np.sign(x),
    "quadratic": lambda v, x, s, _: s[0] * x**2,
    "odd-quadratic": lambda v, x, s, _: s[0] * x * np.abs(x),
    "cubic": lambda v, x, s, _: s[0] * x**3,
    "cross-product": lambda v, x, s, axes: s[0] * v.n[:, axes[0] - 1] * v.n[:, axes[1] - 1],
    "cross-square": lambda v, x, s, axes: s[0] * v.n[:, axes[0] - 1] ** 2,
    "hysteresis": lambda v, x, s, _: -0.5 * s[0] * _changed_sign(x),
    "bias-drift": lambda v, x, s, _: s[0] * v.hours,
    "scale-drift": lambda v, x, s, _: s[0] * v.hours * x,
    "bias-step": lambda v, x, s, _: s[0] * (v.hours > s[1]),
    "scale-step": lambda v, x, s, _: s[0] * x * (v.hours > s[1]),
    "warm-up": lambda v, x, s, _: s[0] * (1.0 - np.exp(-v.hours / s[1])),
    "thermal-lag": lambda v, x, s, _: (
        s[0] * (lagged(v.hours, v.temperature, s[2]) - 20.0) + s[1] * np.exp(-v.hours / s[2])
    ),
    "temperature-bias": lambda v, x, s, _: s[0] * (v.temperature - 20.0),
    "temperature-scale": lambda v, x, s, _: s[0] * (v.temperature - 20.0) * x,
    "temperature-bias-quadratic": lambda v, x, s, _: of_powers(v.temperature, s),
    "temperature-bias-cubic": lambda v, x, s, _: of_powers(v.temperature, s),
    "temperature-scale-quadratic": lambda v, x, s, _: of_powers(v.temperature, s) * x,
    "temperature-scale-cubic": lambda v, x, s, _: of_powers(v.temperature, s) * x,
}
AXES = ("outer-axis", "inner-axis")


def readings_added(visits: Visits, hidden: Sequence[Sized]) -> np.ndarray:
    """Return the change of the readings by effects (N, 3) [g]."""
    added = np.zeros_like(visits.n)
    for place, sizes in hidden:
        if place.effect == "outlier":
            added[int(place.where.removeprefix("position-")) - 1, place.axes[0] - 1] += sizes[0]
        elif place.effect in LAWS:
            p = int(place.where.removeprefix("accelerometer-")) - 1
            added[:, p] += LAWS[place.effect](visits, visits.n[:, p], sizes, place.axes)
    return added


def last_stage(visits: Visits, own: np.ndarray, reading: np.ndarray, hidden: Sequence[Sized]) -> np.ndarray:
    """Return readings (N, 3) [g] after effects on a whole reading; `own` (N, 3) is each input's part in its channel."""
    reading = reading.copy()
    for place, sizes in hidden:
        if place.effect not in ("dead-zone", "saturation", "quantisation", "exchanged-readings"):
            continue
        p, size = int(place.where.removeprefix("accelerometer-")) - 1, sizes[0]
        if place.effect == "dead-zone":
            reading[:, p] -= np.where(np.abs(visits.n[:, p]) < size, own[:, p], 0.0)
        elif place.effect == "saturation":
            reading[:, p] = np.clip(reading[:, p], -size, size)
        elif place.effect == "quantisation":
            reading[:, p] = size * np.round(reading[:, p] / size)
        else:
            late, q = visits.hours > size, place.axes[0] - 1
            swapped = reading[:, [q, p]] if p != q else -reading[:, [p, p]]
            reading[:, [p, q]] = np.where(late[:, None], swapped, reading[:, [p, q]])
    return reading


def slipped(visits: Visits, theta: np.ndarray, hidden: Sequence[Sized]) -> np.ndarray:
    """Return mounting errors (N, 3) [rad] of a block that slips at a time, or turns with time, temperature or an input.

    Beside the mounting error it turns further, about its own axes.
    """
    turns = np.zeros((len(visits.hours), 3))
    for place, (*turn, start) in hidden:
        if place.effect == "mounting-slip":
            turns[visits.hours > start] += turn
        elif place.effect == "mounting-drift":
            turns += np.outer(visits.hours, [*turn, start])
        elif place.effect == "mounting-temperature":
            turns += np.outer(visits.temperature - 20.0, [*turn, start])
        elif place.effect == "fixture-flexure":
            turns[:, place.axes[0] - 1] += start * visits.n[:, place.axes[1] - 1]
    if not turns.any():
        return np.tile(theta, (len(turns), 1))
    return -(Rotation.from_rotvec(-turns) * Rotation.from_rotvec(-theta)).as_rotvec()


def encoders_off(visits: Visits, hidden: Sequence[Sized]) -> np.ndarray:
    """Return the errors of the encoders by effects, reading less true angle (N, 2) [rad]."""
    off = np.zeros((len(visits.hours), 2))
    for place, sizes in hidden:
        if place.effect == "encoder-harmonic":
            axis = AXES.index(place.where)
            off[:, axis] += sizes[0] * np.sin(place.order * visits.angles[:, axis] + sizes[1])
        elif place.effect == "backlash":
            axis = AXES.index(place.where)
            off[:, axis] -= 0.5 * sizes[0] * visits.senses[:, axis]
    return off


def axes_off(visits: Visits, hidden: Sequence[Sized]) -> np.ndarray:
    """Return the further turns of the table's frames by effects (N, 4) [rad]: κ, the outer angle, ε, the inner
    angle."""
    off = np.zeros((len(visits.hours), 4))
    alpha, beta = visits.angles.T
    for place, sizes in hidden:
        if place.effect == "base-drift":
            off[:, 0] += sizes[0] * visits.hours
            off[:, 1] -= sizes[1] * visits.hours
        elif place.effect == "sag" and place.where == "outer-axis":
            off[:, 1] += sizes[0] * np.sin(alpha + sizes[1])
        elif place.effect == "sag":
            off[:, 3] += sizes[0] * np.sin(alpha) * np.cos(beta + sizes[1])
        elif place.effect == "axis-wobble" and place.where == "outer-axis":
            off[:, 0] += sizes[0] * np.cos(place.order * alpha + sizes[1])
        elif place.effect == "axis-wobble":
            off[:, 2] += sizes[0] * np.cos(place.order * beta + sizes[1])
            if place.order > 1:
                off[:, 1] += sizes[2] * np.cos(place.order * beta + sizes[3])
    return off
