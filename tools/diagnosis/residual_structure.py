"""What an unexplained residual depends on."""

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.parametrisation import predicted_input

TERMS = 4
"""Functions of each quantity that are tried together."""


def residual_structure(here: Linearisation, hours: NDArray) -> list[dict[str, object]]:
    """How much of the residual functions of one quantity at a time explain, the most telling first.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    hours : (N,) array
        time of each row since the first

    Returns
    -------
    list of dict
        ``accelerometer``, ``on`` (alpha, beta, input, time) and ``explained``: the part of the residual's sum of
        squares that harmonics of the angle, or powers of the input or the time, take away, adjusted for their number
    """
    n = predicted_input(here.parametrisation, here.point, here.positions)
    found = []
    for p in range(3):
        residual = here.residual.reshape(-1, 3)[:, p]
        quantities = {
            "alpha": harmonics(here.positions.alpha),
            "beta": harmonics(here.positions.beta),
            "input": powers(n[:, p]),
            "time": powers(hours),
        }
        for on, functions in quantities.items():
            found.append({"accelerometer": p + 1, "on": on, "explained": explained_share(functions, residual)})
    return sorted(found, key=lambda entry: -entry["explained"])  # type: ignore[operator]


def harmonics(angle: NDArray) -> NDArray:
    """Two harmonics (N, 4) of an angle."""
    return np.stack([f(k * angle) for k in range(1, TERMS // 2 + 1) for f in (np.sin, np.cos)], axis=1)


def powers(values: NDArray) -> NDArray:
    """Powers 1 to 4 (N, 4) of a quantity, scaled to [-1, 1]."""
    scaled = values / max(float(np.abs(values).max(initial=0.0)), 1e-300)
    return np.stack([scaled**k for k in range(1, TERMS + 1)], axis=1)


def explained_share(functions: NDArray, residual: NDArray) -> float:
    """Adjusted coefficient of determination, not below 0."""
    count = len(residual)
    spread = float(((residual - residual.mean()) ** 2).sum())
    if count <= TERMS + 2 or spread == 0.0:
        return 0.0
    design = np.column_stack((np.ones(count), functions))
    coefficients, *_ = np.linalg.lstsq(design, residual, rcond=1e-10)
    left = float(((residual - design @ coefficients) ** 2).sum())
    return max(0.0, 1.0 - left / spread * (count - 1) / (count - 1 - TERMS))
