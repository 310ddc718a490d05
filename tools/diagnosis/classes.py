"""Effects that no measurement on this bench could tell apart form one class."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation
from trihedron.calibration.parametrisation import Positions, reading_jacobian
from trihedron.diagnosis.extended_fit import rows_at, signature_columns
from trihedron.models.effects import EffectPlace

GRID_STEP_DEG = 15.0
SAME_SPACE = 1e-7
"""Largest sine of an angle between two signature spaces that are called the same."""


def residual_spaces(here: Linearisation, places: Sequence[EffectPlace]) -> list[NDArray]:
    """What each effect's signature adds to the nominal model over a dense set of positions, as orthonormal columns.

    The positions cover the sphere with every mounting of the record, no input near zero; times are unrelated to the
    angles. To first order: the model is linearised at a faultless bench.
    """
    degrees = np.arange(0.5 * GRID_STEP_DEG, 360.0, GRID_STEP_DEG)
    mountings = range(len(here.parametrisation.mountings))
    alpha, beta, mounting = (g.ravel() for g in np.meshgrid(degrees, degrees, mountings, indexing="ij"))
    at = Positions(np.radians(alpha), np.radians(beta), mounting.astype(int))
    # Multiples of the golden ratio, modulo one: times in an order that no angle follows.
    hours = np.arange(len(alpha)) * 0.6180339887498949 % 1.0
    point = np.zeros(len(here.symbols))
    bench = reading_jacobian(here.parametrisation, point, at).reshape(3 * len(alpha), -1)
    basis = column_space(bench)
    rows = rows_at(here, point, at, hours)
    spaces = []
    for place in places:
        columns = signature_columns([place], rows)
        left = columns - basis @ (basis.T @ columns)
        left[:, np.linalg.norm(left, axis=0) < 1e-9 * np.linalg.norm(columns, axis=0)] = 0.0
        spaces.append(column_space(left))
    return spaces


def column_space(columns: NDArray) -> NDArray:
    """Orthonormal basis of the space that columns span."""
    u, values, _ = np.linalg.svd(columns, full_matrices=False)
    return u[:, values > 1e-9 * values.max(initial=0.0)] if values.max(initial=0.0) > 0.0 else u[:, :0]


def same_space(a: NDArray, b: NDArray) -> bool:
    """Whether two orthonormal bases span the same space."""
    return a.shape == b.shape and float(np.linalg.norm(a - b @ (b.T @ a), 2)) < SAME_SPACE


def equivalents(here: Linearisation, place: EffectPlace, others: Sequence[EffectPlace]) -> list[EffectPlace]:
    """Those of `others` that no measurement with these mountings could tell from the effect at `place`."""
    spaces = residual_spaces(here, [place, *others])
    if spaces[0].shape[1] == 0:
        return []
    return [other for other, space in zip(others, spaces[1:], strict=True) if same_space(spaces[0], space)]
