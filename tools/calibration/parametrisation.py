"""What is estimated: the parameters of the fit, and how each mounting's 18 targets follow from them.

With several mountings the mounting error is another one for each and everything else is common; the symmetric baseline
has one scale factor for each accelerometer. The parameters are the targets of case (A1) themselves, so that a target's
weights are unit vectors and any other linear combination is a short sum.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS, input_direction, input_jacobian, target_jacobian
from ...models.bench import target_reading as reading_of_targets

MOUNTING_TARGETS = ("X8", "-X12", "X13")
"""Targets that differ by mounting."""


@dataclass(frozen=True)
class Parametrisation:
    """Parameters of the fit.

    Attributes
    ----------
    symbols : tuple of str
        one for each of the P parameters, `X8@name` where there are several mountings
    mountings : tuple of str
        names of the K mountings
    matrices : (K, 3, 3) array
        Q of each
    selection : (K, 18, P) array
        the 18 targets of each mounting are `selection[k] @ parameters`
    symmetric : bool
        one scale factor for each accelerometer
    """

    symbols: tuple[str, ...]
    mountings: tuple[str, ...]
    matrices: NDArray
    selection: NDArray
    symmetric: bool


@dataclass(frozen=True)
class Positions:
    """Table positions at which the block was, or might be, read.

    Attributes
    ----------
    alpha, beta : (N,) array
        encoder readings [rad]
    mounting : (N,) array of int
        index into the mountings of the parametrisation
    tilts : (N, 2) array or None
        small turns [rad] by which κ and ε differ from the parameters' at each position; none by default
    """

    alpha: NDArray
    beta: NDArray
    mounting: NDArray
    tilts: NDArray | None = None


def parametrise(mountings: Mapping[str, ArrayLike], *, symmetric: bool = False) -> Parametrisation:
    """The parameters for these mountings (name -> Q) and this baseline."""
    names = tuple(mountings)
    own_minus = {minus: plus for plus, minus in SYMMETRIC_PAIRS} if symmetric else {}
    symbols: list[str] = []
    places: list[list[str]] = [[] for _ in names]
    for target in TARGETS:
        if target not in MOUNTING_TARGETS:
            source = own_minus.get(target, target)
            if source == target:
                symbols.append(target)
            for k in range(len(names)):
                places[k].append(source)
            continue
        for k, name in enumerate(names):
            places[k].append(f"{target}@{name}" if len(names) > 1 else target)
    own = [[f"{t}@{name}" if len(names) > 1 else t for t in MOUNTING_TARGETS] for name in names]
    symbols[-3:-3] = [symbol for of_one in own for symbol in of_one]
    selection = np.zeros((len(names), len(TARGETS), len(symbols)))
    for k, of_one in enumerate(places):
        for row, symbol in enumerate(of_one):
            selection[k, row, symbols.index(symbol)] = 1.0
    matrices = np.array([np.asarray(q, dtype=float) for q in mountings.values()])
    return Parametrisation(tuple(symbols), names, matrices, selection, symmetric)


def _arguments(p: Parametrisation, point: NDArray, at: Positions) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    if len(p.mountings) == 1 and at.tilts is None:
        # one turn for all positions, not one for each
        return p.selection[0] @ point, at.alpha, at.beta, p.matrices[0]
    targets = (p.selection @ point)[at.mounting]
    if at.tilts is not None:
        targets[:, [TARGETS.index("X1"), TARGETS.index("X3")]] += at.tilts
    return targets, at.alpha, at.beta, p.matrices[at.mounting]


def _selection(p: Parametrisation, at: Positions) -> NDArray:
    return p.selection[0] if len(p.mountings) == 1 else p.selection[at.mounting]


def predicted_reading(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """The exact reading over g (N, 3) at a point (P,) of the parameters; `sign` as in `models.bench.target_reading`."""
    return reading_of_targets(*_arguments(p, point, at), sign)


def predicted_input(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """The inputs of the accelerometers (N, 3) [g], up to the factor (1 − Δg/g) that readings cannot tell."""
    return input_direction(*_arguments(p, point, at))


def reading_jacobian(p: Parametrisation, point: NDArray, at: Positions, sign: NDArray | None = None) -> NDArray:
    """Derivatives (N, 3, P) of `predicted_reading`."""
    return target_jacobian(*_arguments(p, point, at), sign) @ _selection(p, at)


def direction_jacobian(p: Parametrisation, point: NDArray, at: Positions) -> NDArray:
    """Derivatives (N, 3, P) of `predicted_input`."""
    return input_jacobian(*_arguments(p, point, at)) @ _selection(p, at)
