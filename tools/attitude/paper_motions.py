"""The angular motions of the paper's simulation, as harmonics of ψ, ϑ, γ."""

import numpy as np

from ...models.harmonic_motion import HARMONICS, store_harmonics
from ..errors import InputError, nearest
from .conditions import Conditions

SLOW_AMPLITUDES_DEG = {
    "1": (15.0, 5.0, 15.0),
    "2": (30.0, 10.0, 30.0),
    "3": (15.0, 5.0, 15.0),
    "4": (30.0, 10.0, 30.0),
    "5": (60.0, 20.0, 60.0),
    "6": (120.0, 40.0, 120.0),
    "small": (1.0, 2.0, 3.0),
}
"""Amplitudes [deg] of the motions with one harmonic in each angle."""

SLOW_FREQUENCIES = (1.0, 0.5, 1.0)
"""[Hz]"""

FAST_FREQUENCIES = ((380.0, 400.0, 420.0), (60.0, 80.0, 100.0))
"""First and second harmonics of the compositions [Hz]."""

THIRD_FREQUENCIES = {"first": (1.0, 1.0, 1.0), "second": (1.0, 2.0, 3.0)}
"""Third harmonics of the compositions [Hz]."""

THIRD_AMPLITUDES_DEG = (6.0, 8.0, 10.0)
TYPED_DEG = {2.0 / 60.0: 0.0333, 2.5 / 3600.0: 0.000694, 20.0 / 60.0: 0.333, 25.0 / 3600.0: 0.00694}
"""Amplitudes as they must have been typed [deg]."""

MOTIONS = (*SLOW_AMPLITUDES_DEG, *THIRD_FREQUENCIES)
"""Names of the motions: the variants of Table 1, the small amplitudes of 3.1.1, the two compositions."""


def paper_motion(name: str, conditions: Conditions) -> np.ndarray:
    """A motion of the paper as the harmonics that `trihedron.models.harmonic_motion` takes.

    Parameters
    ----------
    name : str
        one of `MOTIONS`
    conditions : Conditions
        what π, frequencies and amplitudes are

    Returns
    -------
    ndarray, shape (36,)
        amplitude [rad], circular frequency [rad/s] and phase of each harmonic

    Raises
    ------
    InputError
        no motion has this name
    """
    if name not in MOTIONS:
        raise InputError(f"motion {name}: is not known; {nearest(name, MOTIONS)}")
    harmonics = [0.0] * (9 * HARMONICS)
    for axis in range(3):
        if name in THIRD_FREQUENCIES:
            frequencies = (*(harmonic[axis] for harmonic in FAST_FREQUENCIES), THIRD_FREQUENCIES[name][axis])
            amplitudes_deg = _composition_amplitudes_deg(name, axis, conditions)
        else:
            frequencies = (_slow_frequency(name, axis, conditions),)
            amplitudes_deg = (SLOW_AMPLITUDES_DEG[name][axis],)
        store_harmonics(
            axis,
            conditions.pi,
            _padded(np.radians(amplitudes_deg)),
            _padded(frequencies),
            _padded(()),
            harmonics,
        )
    return np.array(harmonics)


def _slow_frequency(name: str, axis: int, conditions: Conditions) -> float:
    if name not in ("3", "4"):
        return SLOW_FREQUENCIES[axis]
    printed = 2.0 * SLOW_FREQUENCIES[axis]
    if conditions.other_frequencies and axis != 1:
        return printed + 1.0 / (2.0 * conditions.pi)
    return printed


def _composition_amplitudes_deg(name: str, axis: int, conditions: Conditions) -> tuple[float, float, float]:
    scale = 1.0 if name == "first" else 10.0
    minutes = (1.0, 1.5 if conditions.smaller_theta else 2.0, 2.0)[axis]
    first, second = scale * 2.5 / 3600.0, scale * minutes / 60.0
    if conditions.typed_amplitudes:
        first, second = _as_typed(first), _as_typed(second)
    return first, second, THIRD_AMPLITUDES_DEG[axis]


def _as_typed(amplitude_deg: float) -> float:
    return next((typed for full, typed in TYPED_DEG.items() if abs(amplitude_deg - full) < 1e-9), amplitude_deg)


def _padded(values: object) -> list[float]:
    given = [float(value) for value in np.asarray(values).reshape(-1)]
    return given + [0.0] * (HARMONICS - len(given))
