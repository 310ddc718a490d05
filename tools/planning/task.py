"""The task of a common set of positions, the readings of such a set, and their costs.

One set serves all targets and all accelerometers at once. A reading counts if the sign of its input is certain by the
admissible set, at every angle within the setting errors. The cost of a target is the least guaranteed error with the
readings that count.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Parametrisation, parametrise
from ..calibration.targets import Target, asked_targets, convention_targets
from ..errors import InputError
from ..progress import shown_status
from ..records import PositionRecord, read_record
from .certificate import ColumnProgramme, UndeterminedError, scaled_optimum
from .continuum import Continuum
from .forms import harmonics, padded_terms, sheets
from .request import FACES, Request, parsed_keep_out

CORNERS = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0))
TURN = 2.0 * np.pi
LINES = 24
"""Lines of each axis on which the keep-outs are checked to leave enough."""
NOT_DETERMINED = 1e3
"""Ratio above which the positions do not determine the target."""
Intervals = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Places:
    """Table positions: angles α and β (N, 2) [rad], and indices into the mountings (N,)."""

    angle: NDArray
    mounting: NDArray

    def __len__(self) -> int:
        return len(self.angle)

    def at(self, angle: NDArray) -> "Places":
        """Return the same mountings at other angles (N, 2)."""
        return Places(angle, self.mounting)

    def chosen(self, rows: Sequence[int] | NDArray) -> "Places":
        """Return some of the places."""
        return Places(self.angle[rows], self.mounting[rows])

    def joined(self, following: "Places") -> "Places":
        """Return these places and the following ones."""
        angle = np.concatenate([self.angle, following.angle])
        return Places(angle, np.concatenate([self.mounting, following.mounting]))


def on_all_mountings(angle: NDArray, mountings: int) -> Places:
    """Return the same angles (N, 2) [rad] with every mounting, one mounting after the other."""
    return Places(np.concatenate([angle] * mountings), np.repeat(np.arange(mountings), len(angle)))


@dataclass(frozen=True)
class Task:
    """The checked request: targets, admissible set, allowed table positions.

    Attributes
    ----------
    request : Request
        the user's request
    parametrisation : Parametrisation
        parameters and mountings
    targets : tuple of Target
        K targets
    best : (K,) array
        cost of each target's own optimal plan over all angles [σ]; their largest if one error counts for all
    groups : tuple of tuples of int
        targets whose errors combine as the root of the sum of their squares: each alone, or pairs of a goal
    least : (G,) array
        lower bound of each group's error by the targets' own optima [σ], for a goal the largest of them
    support : (n, 2) array
        positions of those plans [rad]; none if the costs were given
    keep_out : tuple
        for each axis, intervals [rad] (low, high), low < high, of encoder readings that are not used
    measured : Places
        positions of readings that are there already
    regressor, base, terms : (S, P, 3, 3), (S, 3, 3), (S, T, 3, 3) array
        the sheets, stacked
    accelerometer, mounting : (S,) array of int
        accelerometer and mounting of each sheet
    """

    request: Request
    parametrisation: Parametrisation
    targets: tuple[Target, ...]
    best: NDArray
    groups: tuple[tuple[int, ...], ...]
    least: NDArray
    support: NDArray
    keep_out: tuple[Intervals, Intervals]
    measured: Places
    regressor: NDArray
    base: NDArray
    terms: NDArray
    accelerometer: NDArray
    mounting: NDArray

    @cached_property
    def weights(self) -> NDArray:
        """Return a of every target (K, P)."""
        return np.array([target.weights for target in self.targets])

    @cached_property
    def shifts(self) -> NDArray:
        """Return the corners (C, 2) of the box of setting errors [rad]."""
        if self.request.reserve_deg == 0.0:
            return np.zeros((1, 2))
        return np.radians(self.request.reserve_deg) * np.array(CORNERS)

    @cached_property
    def room(self) -> NDArray:
        """Return the largest drop of the clearance (S,) inside that box below its corners."""
        forms = np.concatenate([self.base[:, None], self.terms], axis=1)
        bent = np.linalg.norm(forms[..., :2, :], 2, axis=(-2, -1)) + np.linalg.norm(forms[..., :, :2], 2, axis=(-2, -1))
        # A form with second derivatives below M is within M r²/2, for each axis, of the interpolation of the corners.
        return 0.5 * np.radians(self.request.reserve_deg) ** 2 * np.sqrt(2.0) * bent.sum(axis=1)


def task_of(request: Request, *, best: NDArray | None = None, progress: bool = False) -> Task:
    """Check a request and find the optimum of every target over all angles, without setting errors.

    `best` (K,) are the optima if they are known already. Raises InputError for invalid options, and if no positions can
    determine a target.
    """
    request.check()
    p = request.parametrisation()
    targets = _targets(p, request.convention, request.expressions)
    keep_out = _keep_outs(request)
    stacked = sheets(p, bounds=request.bounds, rule=request.admissible)
    support = np.zeros((0, 2))
    if best is None:
        with shown_status("optima of the targets", show=progress):
            matrices = tuple((name, matrix.tobytes()) for name, matrix in zip(p.mountings, p.matrices, strict=True))
            u, v = map(float, request.bounds)
            best, support = _optima(
                matrices, p.symmetric, (u, v, request.admissible), request.convention, request.expressions
            )
    if request.goal is None:
        groups = tuple((k,) for k in range(len(best)))
    else:
        groups = tuple((request.expressions.index(one), request.expressions.index(two)) for one, two in FACES)
    least = group_errors(best, groups)
    if request.goal is not None or request.accuracy is not None:
        # The largest error counts, not each relative to its own optimum.
        best, least = np.full(len(best), best.max()), np.full(len(least), least.max())
    task = Task(
        request,
        p,
        tuple(targets),
        best,
        groups,
        least,
        support,
        keep_out,
        measured_places(request.measured, p),
        regressor=np.array([sheet.regressor for sheet in stacked]),
        base=np.array([sheet.base for sheet in stacked]),
        terms=padded_terms(stacked),
        accelerometer=np.array([sheet.accelerometer for sheet in stacked]),
        mounting=np.array([sheet.mounting for sheet in stacked]),
    )
    if missing := _undetermined(task):
        raise InputError(
            f"--keep-out: no positions outside it, with signs that are certain, determine {', '.join(missing)}; "
            "ask for others by --target, or leave more angles by --keep-out"
        )
    return task


def _keep_outs(request: Request) -> tuple[Intervals, Intervals]:
    intervals: tuple[list[tuple[float, float]], list[tuple[float, float]]] = ([], [])
    for text in request.keep_out:
        axis, low, high = parsed_keep_out(text)
        intervals[axis].append((low, high))
    for name, closed in zip(("alpha", "beta"), intervals, strict=True):
        if not free_arcs(closed):
            raise InputError(f"--keep-out: nothing of {name} is left; leave some of its angles free")
    return tuple(intervals[0]), tuple(intervals[1])


def group_errors(errors: NDArray, groups: Sequence[tuple[int, ...]]) -> NDArray:
    """Return errors (G,) of groups of targets from those of the targets (K,)."""
    return np.array([math.hypot(*errors[list(group)]) for group in groups])


def measured_places(path: str | Path | None, p: Parametrisation) -> Places:
    """Return the positions of a record; none without one.

    Raises InputError for a record of other mountings.
    """
    if path is None:
        return Places(np.zeros((0, 2)), np.zeros(0, dtype=int))
    record = read_record(Path(path), PositionRecord)
    names = record.mounting or p.mountings[:1] * len(record)
    if (record.mounting is None and len(p.mountings) > 1) or not set(names) <= set(p.mountings):
        raise InputError(f"--measured {path}: its mountings are not those of the plan, {', '.join(p.mountings)}")
    return Places(np.column_stack([record.alpha, record.beta]), np.array([p.mountings.index(name) for name in names]))


def _undetermined(task: Task) -> list[str]:
    """Return the targets that neither the angles outside the keep-outs nor the measured positions determine."""
    if not any(task.keep_out):
        return []
    lines = []
    for intervals in task.keep_out:
        arcs = free_arcs(intervals)
        lines.append(np.concatenate([np.linspace(low, high, LINES // len(arcs) + 2) for low, high in arcs]))
    angle = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 2)
    everywhere = on_all_mountings(angle, len(task.parametrisation.mountings)).joined(task.measured)
    return costs(task, everywhere).missing(task)


def _targets(p: Parametrisation, convention: str, expressions: tuple[str, ...]) -> list[Target]:
    if expressions:
        return asked_targets(expressions, p)
    return convention_targets(p, convention)


@lru_cache(maxsize=64)
def _optima(
    mountings: tuple[tuple[str, bytes], ...],
    symmetric: bool,
    admissible: tuple[float, float, str],
    convention: str,
    expressions: tuple[str, ...],
) -> tuple[NDArray, NDArray]:
    """Return the cost (K,) of each target's own optimal plan over all angles [σ], and all their positions (n, 2) [rad].

    They take seconds and depend only on the arguments, so they are cached. The arrays are read-only. `admissible` has
    both bounds and the rule.
    """
    u, v, rule = admissible
    matrices = {name: np.frombuffer(matrix).reshape(3, 3) for name, matrix in mountings}
    p = parametrise(matrices, symmetric=symmetric)
    everywhere = Continuum(sheets(p, bounds=(u, v), rule=rule))
    targets = _targets(p, convention, expressions)
    try:
        optima = [scaled_optimum(everywhere.optimum, target.weights) for target in targets]
    except UndeterminedError:
        raise InputError("the admissible positions cannot determine every target; give smaller --bounds") from None
    best = np.array([optimum.cost for optimum in optima])
    support = np.concatenate([np.column_stack([optimum.alpha, optimum.beta]) for optimum in optima])
    best.setflags(write=False)
    support.setflags(write=False)
    return best, support


def clearances(task: Task, places: Places) -> NDArray:
    """Return the clearance (N, S) [g] of each sheet at each position within setting errors; a reading counts above
    0."""
    lowest = np.full((len(places), len(task.base)), np.inf)
    for shift in task.shifts:
        a, b = harmonics(places.angle[:, 0] + shift[0]), harmonics(places.angle[:, 1] + shift[1])
        clear = np.einsum("sij,ni,nj->ns", task.base, a, b, optimize=True)
        clear -= np.abs(np.einsum("stij,ni,nj->nst", task.terms, a, b, optimize=True)).sum(axis=2)
        lowest = np.minimum(lowest, clear)
    lowest -= task.room
    lowest[places.mounting[:, None] != task.mounting] = -np.inf
    return lowest


@dataclass(frozen=True)
class CertainReadings:
    """The readings that count: positions and sheets (M,), regressors F (M, P), clearances (M,) [g]."""

    position: NDArray
    sheet: NDArray
    regressor: NDArray
    clearance: NDArray


def readings(task: Task, places: Places) -> CertainReadings:
    """Return the readings of a set of positions whose inputs are certain."""
    clear = clearances(task, places)
    position, sheet = np.nonzero(clear > 0.0)
    a, b = harmonics(places.angle[position, 0]), harmonics(places.angle[position, 1])
    f = np.einsum("mpij,mi,mj->mp", task.regressor[sheet], a, b, optimize=True)
    return CertainReadings(position, sheet, f, clear[position, sheet])


@dataclass(frozen=True)
class Costs:
    """The cost of every target on a set of positions.

    Attributes
    ----------
    places : Places
        the positions
    readings : CertainReadings
        their readings that count
    weights : (K, M) array
        Φ of each target's estimator
    duals : (K, P) array
        y: |F'y| ≤ 1 on the readings, a'y the cost
    ratio : (K,) array
        cost over the target's optimum over all angles
    worst : float
        the largest ratio; for a goal, the ratio of its error to the least possible one
    """

    places: Places
    readings: CertainReadings
    weights: NDArray
    duals: NDArray
    ratio: NDArray
    worst: float

    @property
    def mean(self) -> float:
        """Mean ratio."""
        return float(self.ratio.mean())

    @property
    def complete(self) -> bool:
        """True if the positions determine every target."""
        return bool((self.ratio < NOT_DETERMINED).all())

    def missing(self, task: Task) -> list[str]:
        """Return the symbols of the targets that the positions do not determine."""
        return [task.targets[k].symbol for k in np.flatnonzero(self.ratio >= NOT_DETERMINED)]


def costs(task: Task, places: Places) -> Costs:
    """Solve the linear programme of every target on the readings of these positions."""
    counted = readings(task, places)
    weights = np.zeros((len(task.targets), len(counted.position)))
    duals, errors = np.zeros_like(task.weights), np.zeros(len(task.targets))
    programme = ColumnProgramme(task.weights.shape[1])
    if len(counted.position):
        programme.add(counted.regressor)
    for k, target in enumerate(task.weights):
        programme.aim(target)
        weights[k], duals[k], possible = programme.solve()
        errors[k] = duals[k] @ target
        if possible:
            used = np.flatnonzero(weights[k])
            columns = counted.regressor[used].T
            # Remove the solver's tolerance.
            weights[k, used] += np.linalg.lstsq(columns, target - columns @ weights[k, used], rcond=1e-12)[0]
    worst = float((group_errors(errors, task.groups) / task.least).max())
    return Costs(places, counted, weights, duals, errors / task.best, worst)


def allowed(task: Task, angle: NDArray) -> NDArray:
    """Return a mask of the positions (N, 2) [rad] that lie in no keep-out, ends included, or are measured already."""
    free = np.ones(len(angle), dtype=bool)
    for axis, intervals in enumerate(task.keep_out):
        for low, high in intervals:
            inside = np.mod(angle[:, axis] - low, TURN)
            free &= ~((inside > 1e-12) & (inside < high - low - 1e-12))
    return free | _is_measured(task, angle)


def _is_measured(task: Task, angle: NDArray) -> NDArray:
    return (angle[:, None] == task.measured.angle[None]).all(axis=2).any(axis=1)


def free_arcs(intervals: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the arcs [rad] (low, high), low < high, that an axis' keep-outs leave free; empty if there are none."""
    if not intervals:
        return [(0.0, TURN)]
    ends = np.unique(np.mod(np.ravel(intervals), TURN)).tolist()
    arcs = []
    for start, end in pairwise([*ends, ends[0] + TURN]):
        middle = 0.5 * (start + end)
        closed = any((middle - low) % TURN < high - low for low, high in intervals)
        if end - start > 1e-9 and not closed:
            arcs.append((start, end))
    return arcs


def freedom(task: Task, angle: NDArray, radius: float) -> tuple[NDArray, NDArray]:
    """Return the distance (N, 2) by which each angle may go down and up [rad], at most `radius`, outside keep-outs.

    Measured positions stay.
    """
    reach = np.where(_is_measured(task, angle)[:, None], 0.0, radius) * np.ones(2)
    down, up = reach, reach.copy()
    for axis, intervals in enumerate(task.keep_out):
        for low, high in intervals:
            up[:, axis] = np.minimum(up[:, axis], np.mod(low - angle[:, axis] + 1e-12, TURN))
            down[:, axis] = np.minimum(down[:, axis], np.mod(angle[:, axis] - high + 1e-12, TURN))
    return np.maximum(down - 1e-12, 0.0), np.maximum(up - 1e-12, 0.0)
