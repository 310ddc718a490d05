"""Regressors and admissible sets as bilinear forms in (cos α, sin α, 1) and (cos β, sin β, 1).

For one accelerometer p and one sign s of its input every regressor of (1.10) is a form `basis(α)ᵀ C basis(β)` with
a matrix C (3, 3), and so is F'y for any y: this is what makes pricing and bounding cheap. The set of (1.9) is
{c ≥ 0} with c = (1 − v) s m_p − w − Σ weight |term|, its terms forms too (w is v for the rule "tables", else 0).

Source: Golovan, Matasov, Tarygin 2022, (1.7), (1.9), (1.10).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.bench import TARGETS
from ...models.regressors import ASYMMETRIC_SLOTS
from ..calibration.model import Parametrisation
from ..calibration.targets import IN_TARGETS
from ..errors import InputError

DEFAULT_BOUNDS = (3e-3, 1e-2)
"""u^max [rad] and v^0max of section 3 of the paper."""
MOST_TERMS = 5
"""Absolute values in s_p^max: three of the stand, two of the other accelerometers' inputs."""
RULES = ("paper", "tables")
"""(1.7) as printed; with the bias rows too, as the published tables were computed."""


@dataclass(frozen=True)
class Sheet:
    """One accelerometer with one sign of its input: its regressor and the set where that sign is certain.

    Attributes
    ----------
    accelerometer : int
        p, from 0
    sign : int
        s: +1 or -1; 0 for a symmetric block, whose regressor does not depend on the sign
    regressor : (P, 3, 3) array
        a form for each parameter
    base : (3, 3) array
        c without its absolute values
    terms : (T, 3, 3) array
        the forms in absolute value, each times its weight; T ≤ `MOST_TERMS`
    mounting : int
        index into the mountings of the parametrisation
    """

    accelerometer: int
    sign: int
    regressor: NDArray
    base: NDArray
    terms: NDArray
    mounting: int = 0


def basis(angle: ArrayLike) -> NDArray:
    """(cos, sin, 1) of angles (...) [rad], as (..., 3)."""
    angle = np.asarray(angle, dtype=float)
    return np.stack([np.cos(angle), np.sin(angle), np.ones_like(angle)], axis=-1)


def input_form(row: NDArray) -> NDArray:
    """The form (3, 3) of m_p = (Q s)_p for row p of Q (3,)."""
    form = np.zeros((3, 3))
    form[1, 1], form[1, 0], form[0, 2] = row
    return form


def stand_forms(row: NDArray) -> NDArray:
    """The forms (3, 3, 3) of (Q B)_p, the derivatives by κ, Δα + α*, ε, for row p of Q (3,)."""
    first, second, third = row
    forms = np.zeros((3, 3, 3))
    forms[0, 2, 0], forms[0, 2, 1] = -first, second
    forms[1, 0, 1], forms[1, 0, 0], forms[1, 1, 2] = -first, -second, third
    forms[2, 0, 0], forms[2, 0, 1] = -first, second
    return forms


def sheets(p: Parametrisation, *, bounds: tuple[float, float] = DEFAULT_BOUNDS, rule: str = "paper") -> list[Sheet]:
    """The sheets of a block with one mounting: six, or three for a symmetric block, for which every position counts.

    Parameters
    ----------
    p : Parametrisation
        with one mounting
    bounds : (float, float)
        u^max [rad] and v^0max of (1.7)
    rule : {"paper", "tables"}
        as `models.regressors.sign_margin`

    Raises
    ------
    InputError
        for several mountings, another rule, or bounds that are negative, not finite, or leave no position
    """
    if len(p.mountings) != 1:
        names = ", ".join(p.mountings)
        raise InputError(f"--mounting: holds {len(p.mountings)} mountings ({names}); a plan is for one")
    return sheets_of_mountings(p, bounds=bounds, rule=rule)


def sheets_of_mountings(
    p: Parametrisation, *, bounds: tuple[float, float] = DEFAULT_BOUNDS, rule: str = "paper"
) -> list[Sheet]:
    """The sheets of every mounting, one mounting after the other; as `sheets`."""
    if rule not in RULES:
        raise InputError(f"--admissible {rule}: must be one of {', '.join(RULES)}")
    if len(bounds) != 2:
        raise InputError(f"--bounds {' '.join(f'{b:g}' for b in bounds)}: must be two numbers")
    u, v = bounds
    if not (np.isfinite(bounds).all() and u >= 0.0 and v >= 0.0):
        raise InputError(f"--bounds {u:g} {v:g}: both must be finite and not negative")
    found = []
    for mounting, matrix in enumerate(p.matrices):
        found += _sheets_of(p, mounting, matrix, bounds, rule)
    _check_not_empty(found, bounds)
    return found


def _sheets_of(
    p: Parametrisation, mounting: int, matrix: NDArray, bounds: tuple[float, float], rule: str
) -> list[Sheet]:
    u, v = bounds
    to_x = x_from_targets() @ p.selection[mounting]
    inputs = np.array([input_form(row) for row in matrix])
    found = []
    for index, row in enumerate(matrix):
        stand = stand_forms(row)
        for sign in (0,) if p.symmetric else (1, -1):
            x = np.zeros((18, 3, 3))
            x[:3] = stand
            for column, slot in enumerate(ASYMMETRIC_SLOTS[index]):
                x[slot + (column == index and sign < 0)] = inputs[column]
            x[15 + index, 2, 2] = 1.0
            regressor = np.tensordot(to_x, x, axes=(0, 0))
            base, terms = np.zeros((3, 3)), np.zeros((0, 3, 3))
            if sign:
                base = sign * (1.0 - v) * inputs[index]
                base[2, 2] = -v if rule == "tables" else 0.0
                others = [v * inputs[c] for c in range(3) if c != index]
                terms = np.array([term for term in (*(u * stand), *others) if term.any()]).reshape(-1, 3, 3)
            found.append(Sheet(index, sign, regressor, base, terms, mounting))
    return found


def x_from_targets() -> NDArray:
    """X (18) of the paper as a function of the targets (18), as a matrix (18, 18)."""
    matrix = np.zeros((18, 18))
    for k in range(18):
        symbol = f"X{k + 1}"
        for target, factor in IN_TARGETS.get(symbol, {symbol: 1.0}).items():
            matrix[k, TARGETS.index(target)] = factor
    return matrix


def _check_not_empty(found: Sequence[Sheet], bounds: tuple[float, float]) -> None:
    angle = np.radians(np.arange(0.0, 360.0, 5.0))
    for sheet in found:
        if bounds[1] >= 1.0 or clearance(sheet, angle[:, None], angle[None, :]).max() <= 0.0:
            raise InputError(
                f"--bounds {bounds[0]:g} {bounds[1]:g}: leave no position where the sign of accelerometer "
                f"{sheet.accelerometer + 1}'s input is certain; give smaller bounds"
            )


def dual_forms(found: Sequence[Sheet], dual: NDArray) -> NDArray:
    """F'y (S, 3, 3) of each sheet for a dual y (P,)."""
    return np.array([np.tensordot(dual, sheet.regressor, axes=(0, 0)) for sheet in found])


def value(form: NDArray, alpha: ArrayLike, beta: ArrayLike) -> NDArray:
    """Values (..., K) of forms (K, 3, 3), or (...) of one form (3, 3), at angles (...) that broadcast [rad]."""
    a, b = basis(alpha), basis(beta)
    if form.ndim == 2:
        return ((a @ form) * b).sum(axis=-1)
    return np.einsum("kij,...i,...j->...k", form, a, b)


def clearance(sheet: Sheet, alpha: ArrayLike, beta: ArrayLike) -> NDArray:
    """c (...): |m_p| − s_p^max for the sheet's sign, positive where (1.9) holds; 1 everywhere for a symmetric block."""
    if sheet.sign == 0:
        return np.ones(np.broadcast_shapes(np.shape(alpha), np.shape(beta)))
    c = value(sheet.base, alpha, beta)
    for term in sheet.terms:
        c = c - np.abs(value(term, alpha, beta))
    return c
