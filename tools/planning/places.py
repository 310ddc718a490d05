"""What is asked of a common set of positions, and the readings that such a set gives.

One set serves all targets and all accelerometers at once: a reading counts where the sign of its input is certain by
the admissible set, at every angle that an error of setting may lead to.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Parametrisation
from ..calibration.targets import Target
from .continuum import Continuum
from .forms import basis, sheets_of_mountings

CORNERS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))


@dataclass(frozen=True)
class Places:
    """Table positions.

    Attributes
    ----------
    angle : (N, 2) array
        α and β [rad]
    mounting : (N,) array of int
        index into the mountings
    """

    angle: NDArray
    mounting: NDArray

    def __len__(self) -> int:
        """N."""
        return len(self.angle)

    def at(self, angle: NDArray) -> "Places":
        """The same mountings at other angles (N, 2)."""
        return Places(angle, self.mounting)

    def chosen(self, rows: Sequence[int] | NDArray) -> "Places":
        """Some of them."""
        return Places(self.angle[rows], self.mounting[rows])


@dataclass(frozen=True)
class Task:
    """What is asked: targets, admissible set, where the table may stand.

    Attributes
    ----------
    parametrisation : Parametrisation
    targets : tuple of Target
        K of them
    best : (K,) array
        cost of each target's own optimal plan over all angles [σ]
    support : (n, 2) array
        positions of those plans [rad]; none where the costs were given
    bounds : (float, float)
        u^max [rad] and v^0max of (1.7)
    rule : {"paper", "tables"}
        of the admissible set
    reserve : float
        error of setting [rad] at which readings still count
    keep_out : tuple
        of each axis, intervals [rad] (low, high), low < high, of encoder readings that are not used
    regressor, base, terms : (S, P, 3, 3), (S, 3, 3), (S, T, 3, 3) array
        the sheets, stacked
    accelerometer, mounting : (S,) array of int
        of each sheet
    room : (S,) array
        how far the clearance inside the box of setting errors may lie below that of its corners
    """

    parametrisation: Parametrisation
    targets: tuple[Target, ...]
    best: NDArray
    support: NDArray
    bounds: tuple[float, float]
    rule: str
    reserve: float
    keep_out: tuple[tuple[tuple[float, float], ...], tuple[tuple[float, float], ...]]
    regressor: NDArray
    base: NDArray
    terms: NDArray
    accelerometer: NDArray
    mounting: NDArray
    room: NDArray

    @property
    def weights(self) -> NDArray:
        """a of every target (K, P)."""
        return np.array([target.weights for target in self.targets])

    @property
    def shifts(self) -> NDArray:
        """Corners (C, 2) of the box of setting errors [rad]."""
        return self.reserve * np.array(CORNERS) if self.reserve > 0.0 else np.zeros((1, 2))


def task_of(
    p: Parametrisation,
    targets: Sequence[Target],
    *,
    bounds: tuple[float, float],
    rule: str,
    reserve: float = 0.0,
    keep_out: Mapping[int, Sequence[tuple[float, float]]] | None = None,
    best: NDArray | None = None,
) -> Task:
    """What is asked, with the continuum optimum of every target on the same admissible set (without reserve).

    Parameters
    ----------
    best : (K,) array or None
        the optima where they are known already; computed when None

    Raises
    ------
    InputError
        for bounds or rules that cannot be used
    UndeterminedError
        when no positions can determine a target
    """
    found = sheets_of_mountings(p, bounds=bounds, rule=rule)
    most = max(len(sheet.terms) for sheet in found)
    terms = np.zeros((len(found), most, 3, 3))
    base = np.array([sheet.base for sheet in found])
    for k, sheet in enumerate(found):
        terms[k, : len(sheet.terms)] = sheet.terms
        base[k, 2, 2] += 1.0 if sheet.sign == 0 else 0.0
    forms = np.concatenate([base[:, None], terms], axis=1)
    bent = np.linalg.norm(forms[..., :2, :], 2, axis=(-2, -1)) + np.linalg.norm(forms[..., :, :2], 2, axis=(-2, -1))
    support = np.zeros((0, 2))
    if best is None:
        search = Continuum(found)
        sizes = [float(np.abs(target.weights).max()) for target in targets]
        optima = [search.optimum(t.weights / s).times(s) for t, s in zip(targets, sizes, strict=True)]
        best = np.array([optimum.cost for optimum in optima])
        support = np.concatenate([np.column_stack([optimum.alpha, optimum.beta]) for optimum in optima])
    forbidden = keep_out or {}
    return Task(
        parametrisation=p,
        targets=tuple(targets),
        best=best,
        support=support,
        bounds=bounds,
        rule=rule,
        reserve=reserve,
        keep_out=(tuple(forbidden.get(0, ())), tuple(forbidden.get(1, ()))),
        regressor=np.array([sheet.regressor for sheet in found]),
        base=base,
        terms=terms,
        accelerometer=np.array([sheet.accelerometer for sheet in found]),
        mounting=np.array([sheet.mounting for sheet in found]),
        # A form with second derivatives below M is within M r²/2, for each axis, of the interpolation of the corners.
        room=0.5 * reserve**2 * np.sqrt(2.0) * bent.sum(axis=1),
    )


def slopes(angle: NDArray) -> NDArray:
    """Derivative (..., 3) of `basis`."""
    return np.stack([-np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=-1)


def clearances(task: Task, places: Places) -> NDArray:
    """Clearance (N, S) [g] of each sheet at each position, setting errors allowed for; a reading counts above 0."""
    lowest = np.full((len(places), len(task.base)), np.inf)
    for shift in task.shifts:
        a, b = basis(places.angle[:, 0] + shift[0]), basis(places.angle[:, 1] + shift[1])
        clear = np.einsum("sij,ni,nj->ns", task.base, a, b, optimize=True)
        clear -= np.abs(np.einsum("stij,ni,nj->nst", task.terms, a, b, optimize=True)).sum(axis=2)
        lowest = np.minimum(lowest, clear)
    lowest -= task.room
    lowest[places.mounting[:, None] != task.mounting] = -np.inf
    return lowest


@dataclass(frozen=True)
class Readings:
    """The readings that count.

    Attributes
    ----------
    position, sheet : (M,) array of int
    regressor : (M, P) array
        F
    clearance : (M,) array
        [g]
    """

    position: NDArray
    sheet: NDArray
    regressor: NDArray
    clearance: NDArray


def readings(task: Task, places: Places) -> Readings:
    """The readings of a set of positions whose inputs are certain."""
    clear = clearances(task, places)
    position, sheet = np.nonzero(clear > 0.0)
    a, b = basis(places.angle[position, 0]), basis(places.angle[position, 1])
    f = np.einsum("mpij,mi,mj->mp", task.regressor[sheet], a, b, optimize=True)
    return Readings(position, sheet, f, clear[position, sheet])


def allowed(task: Task, angle: NDArray) -> NDArray:
    """Which positions (N, 2) [rad] lie in no keep-out, ends included."""
    free = np.ones(len(angle), dtype=bool)
    for axis, intervals in enumerate(task.keep_out):
        for low, high in intervals:
            inside = np.mod(angle[:, axis] - low, 2.0 * np.pi)
            free &= ~((inside > 1e-12) & (inside < high - low - 1e-12))
    return free


def free_arcs(intervals: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """What an axis' keep-outs leave of a turn: arcs [rad] (low, high), low < high; none where they leave nothing."""
    turn = 2.0 * np.pi
    if not intervals:
        return [(0.0, turn)]
    ends = np.unique(np.mod(np.ravel(intervals), turn))
    return [
        (float(a), float(b))
        for a, b in pairwise([*ends, ends[0] + turn])
        if b - a > 1e-9 and not any((0.5 * (a + b) - low) % turn < high - low for low, high in intervals)
    ]


def freedom(task: Task, angle: NDArray, radius: float) -> tuple[NDArray, NDArray]:
    """How far (N, 2) each angle may go down and up [rad], at most `radius`, without entering a keep-out."""
    down, up = np.full(angle.shape, radius), np.full(angle.shape, radius)
    for axis, intervals in enumerate(task.keep_out):
        for low, high in intervals:
            up[:, axis] = np.minimum(up[:, axis], np.mod(low - angle[:, axis] + 1e-12, 2.0 * np.pi))
            down[:, axis] = np.minimum(down[:, axis], np.mod(angle[:, axis] - high + 1e-12, 2.0 * np.pi))
    return np.maximum(down - 1e-12, 0.0), np.maximum(up - 1e-12, 0.0)
