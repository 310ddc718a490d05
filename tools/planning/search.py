"""The best common set of positions.

Many starts are improved locally, and the best ones changed in part. Local improvement is sequential linear programming
in the angles and all weights at once. Unknown are the angles θ and the weights Φ of every target's estimator: least r
with Σ Φ F(θ) = a and Σ|Φ| ≤ r c. About the present weights the products Φ F(θ) are linear in dθ and the new Φ, to
second order; readings that count must go on counting. A step is kept when the exact costs fall, and the region of
trust follows what the steps are worth.

Random numbers come from the seed, and the budget is counted in starts: the same options find the same plan.
"""

from collections.abc import Callable, Sequence
from itertools import product
from math import hypot

import highspy
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, block_diag, csc_array

from ..bounded.programmes import UNSCALED, Solver, linear_programme
from ..progress import progress_bar
from ..rounding import upwards
from .certificate import NO_WEIGHT
from .forms import basis, slopes
from .positions import (
    NOT_DETERMINED,
    Costs,
    Places,
    Task,
    allowed,
    costs,
    free_arcs,
    freedom,
)

ELITE = 6
"""So many of the best sets are kept and changed."""
ALIKE = 1e-6
"""Sets whose merit differs by less count as one."""
FRESH = 0.2
"""Share of starts that begin anew when there is something to change."""
DRAWS = 6
"""Of so many random sets the best one is improved."""
SPREAD_DEG = 8.0
"""How far from the axes' multiples of 90° a start looks, where it does."""
GIVE_UP = ((8, 0.05), (15, 0.01))
"""After so many steps an improvement must be so near the best sets [ratio], relative to what they lose themselves."""
REDRAWS = 200
FACETS = 9
"""Of a quarter of the cone of a level's error."""
LITTLE = 1e-3
"""Weight of the mean ratio beside the worst: ties are broken by it."""
WIDE, FINEST = 0.3, 1e-7
"""Largest and least radius of trust [rad]."""
NEAR_ONE = 0.35
"""Columns with |F'y| so far below one do not enter a step's programme."""
INSIDE = 2e-10
"""Clearance [g] that a step leaves to readings on the boundary."""
GAIN = 1e-10
SMALL_GAIN, SMALL_STEPS = 1e-6, 4
"""An improvement ends after so many steps in a row that gain so little."""
HOW: tuple[tuple[str, str | int | bool], ...] = (
    *(("output_flag", False), ("threads", 1), ("parallel", "off"), ("solver", "simplex"), ("presolve", "off")),
    *(("simplex_scale_strategy", UNSCALED), ("simplex_dual_edge_weight_strategy", 1)),
)
"""A step's programme is scaled as it is, and small: without presolve and scaling it takes half the time."""
MENDINGS = 6


def search(
    task: Task,
    count: int,
    *,
    given: Sequence[Places] = (),
    enough: float = 0.0,
    progress: bool = False,
) -> tuple[Costs | None, int, bool]:
    """Look for the best set of so many positions; Ctrl-C ends the search and keeps the best so far, if there is any.

    Parameters
    ----------
    task : Task
        its request says which criterion, how many starts, and the seed of the random numbers
    given : sequence of Places
        sets to begin with, beside the random ones
    enough : float
        the worst ratio with which the search ends

    Returns
    -------
    best : Costs or None
        None when no set was found that determines all targets
    starts : int
        local improvements that were made
    interrupted : bool
        whether Ctrl-C ended the search before its budget was spent
    """
    rng, starts = np.random.default_rng(task.request.seed), task.request.starts
    elite: list[tuple[float, Costs]] = []
    done, interrupted = 0, False
    with progress_bar(f"{count} positions", len(given) + starts, show=progress) as advance:
        try:
            for places in [*given, *([None] * starts)]:
                start = _start(task, count, rng, elite) if places is None else costs(task, places)
                found = improve(task, start, hopeless=_hopeless(elite))
                done += 1
                value = merit(task, found)
                if all(abs(value - other) > ALIKE for other, _ in elite):
                    elite.append((value, found))
                    elite.sort(key=lambda pair: pair[0])
                    del elite[ELITE:]
                state = (
                    f"{count} positions, ratio {upwards(elite[0][1].worst, 6)}"
                    if elite[0][1].determined.all()
                    else None
                )
                advance(1, state)
                if elite[0][1].worst <= enough and elite[0][1].determined.all():
                    break
        except KeyboardInterrupt:
            if not elite:
                raise
            interrupted = True
    best = elite[0][1] if elite and elite[0][1].determined.all() else None
    return best, done, interrupted


def _hopeless(elite: Sequence[tuple[float, Costs]]) -> Callable[[int, float], bool]:
    if len(elite) < ELITE:
        return lambda step, value: False
    last = elite[-1][0]
    room = max(1.0, last - 1.0)
    return lambda step, value: any(step == at and value > last + share * room for at, share in GIVE_UP)


def _start(task: Task, count: int, rng: np.random.Generator, elite: Sequence[tuple[float, Costs]]) -> Costs:
    """A set to improve: random, or one of the best with one or two positions drawn anew."""
    if len(elite) < ELITE or rng.random() < FRESH:
        trials = [costs(task, drawn(task, count, rng).joined(task.measured)) for _ in range(DRAWS)]
    else:
        base = elite[int(rng.integers(len(elite)))][1].places
        trials = []
        for _ in range(2):
            rows = rng.choice(count, min(count, int(rng.integers(1, 3))), replace=False)
            new = drawn(task, len(rows), rng)
            angle, mounting = base.angle.copy(), base.mounting.copy()
            angle[rows], mounting[rows] = new.angle, new.mounting
            trials.append(costs(task, Places(angle, mounting)))
    return min(trials, key=lambda found: (min(found.worst, NOT_DETERMINED), found.mean))


def drawn(task: Task, count: int, rng: np.random.Generator) -> Places:
    """Random positions outside the keep-outs: anywhere, or near multiples of 90° of both axes."""
    angle = _random_angles(count, rng, bool(rng.integers(2)))
    for _ in range(REDRAWS):
        wrong = ~allowed(task, angle)
        if not wrong.any():
            break
        angle[wrong] = _random_angles(int(wrong.sum()), rng, False)
    else:
        wrong = ~allowed(task, angle)
        angle[wrong] = _free_angles(task, int(wrong.sum()), rng)
    return Places(angle, rng.integers(0, len(task.parametrisation.mountings), count))


def _free_angles(task: Task, count: int, rng: np.random.Generator) -> NDArray:
    """Random angles outside keep-outs that leave little: an arc by its width, then anywhere on it."""
    angle = np.zeros((count, 2))
    for axis, intervals in enumerate(task.keep_out):
        low, high = np.array(free_arcs(intervals)).T
        arc = rng.choice(len(low), count, p=(high - low) / (high - low).sum())
        angle[:, axis] = rng.uniform(low[arc], high[arc])
    return angle


def _random_angles(count: int, rng: np.random.Generator, near_axes: bool) -> NDArray:
    if not near_axes:
        return rng.uniform(0.0, 2.0 * np.pi, (count, 2))
    return np.radians(90.0 * rng.integers(0, 4, (count, 2)) + rng.normal(0.0, SPREAD_DEG, (count, 2)))


def merit(task: Task, found: Costs) -> float:
    """What is made small: the worst ratio with a little of the mean, or the mean with a little of the worst.

    For a goal the worst ratio is that of its error.
    """
    if task.request.criterion == "mean":
        return found.mean + LITTLE * found.worst
    return found.worst + LITTLE * found.mean


def improve(
    task: Task,
    start: Costs,
    *,
    radius: float = WIDE,
    steps: int = 40,
    hopeless: Callable[[int, float], bool] = lambda step, value: False,
) -> Costs:
    """Improve a set of positions until no small move helps; what comes is never worse than the start.

    An angle may move by the radius [rad] in the first step; some steps in a row that gain little end
    it, and `hopeless` says of step and merit whether to give up.
    """
    best, value, slow = start, merit(task, start), 0
    for number in range(steps):
        step = _step(task, best, radius)
        if step is None:
            radius *= 0.3
        else:
            move, promised = step
            angle = _mended(task, best, best.places.angle + move)
            trial = costs(task, best.places.at(angle))
            gained, hoped = value - merit(task, trial), value - promised
            if gained > GAIN and allowed(task, angle).all():
                slow = slow + 1 if gained < SMALL_GAIN else 0
                best, value = trial, value - gained
                radius = min(WIDE, radius * (2.0 if gained > 0.5 * hoped else 0.5 if gained < 0.1 * hoped else 1.0))
            else:
                radius *= 0.3
        if radius < FINEST or slow >= SMALL_STEPS or hopeless(number, value):
            break
    return best


def _step(task: Task, here: Costs, radius: float) -> tuple[NDArray, float] | None:
    """A step of the angles (N, 2) [rad] and the merit that the linear model promises; None where it has no solution."""
    places, given, (many, size) = here.places, here.readings, task.weights.shape
    kept = (np.abs(here.weights) > NO_WEIGHT).any(axis=0) | (given.clearance > 2.0 * radius)
    worst = task.request.criterion == "worst"
    height = here.duals @ given.regressor.T
    near = kept & ((np.abs(height) > 1.0 - NEAR_ONE) | (here.weights != 0.0))
    blocks = []
    for own, tall in zip(near, height, strict=True):
        plus, minus = (own & ((sense * tall > 0.0) | (np.abs(tall) < 0.2)) for sense in (1.0, -1.0))
        blocks.append(np.hstack([given.regressor[plus].T, -given.regressor[minus].T]))
    sizes = [block.shape[1] for block in blocks]
    moved = _by_angles(task, here)
    moved = np.where(np.abs(moved) > 1e-13, moved, 0.0).transpose(0, 2, 1).reshape(many * size, -1)
    edges, least = _edges(task, here, np.flatnonzero(kept), radius)
    counted, most = _counted(task, here)
    sums = counted @ block_diag([np.ones((1, n)) for n in sizes])
    matrix = csc_array(
        block_array([[block_diag(blocks), moved, None], [csc_array(sums), None, -most[:, None]], [None, edges, None]])
    )
    down, up = freedom(task, places.angle, radius)
    free, angles = sum(sizes), down.size
    cost = np.repeat((LITTLE if worst else 1.0) / many / task.best, sizes)
    model = linear_programme(
        np.concatenate([cost, np.zeros(angles), [1.0 if worst else LITTLE]]),
        (
            np.concatenate([np.zeros(free), -down.ravel(), [0.0]]),
            np.concatenate([np.full(free, np.inf), up.ravel(), [np.inf]]),
        ),
        (matrix.indptr, matrix.indices, matrix.data),
        (
            np.concatenate([task.weights.ravel(), np.full(len(counted), -np.inf), least]),
            np.concatenate([task.weights.ravel(), np.zeros(len(counted)), np.full(len(least), np.inf)]),
        ),
    )
    highs = Solver()
    for name, option in HOW:
        highs.setOptionValue(name, option)
    if highs.passModel(model) == highspy.HighsStatus.kError:
        return None
    highs.run()
    if highs.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    move = np.array(highs.getSolution().col_value)[free : free + angles].reshape(down.shape)
    return move, float(highs.getInfo().objective_function_value)


def _counted(task: Task, here: Costs) -> tuple[NDArray, NDArray]:
    """Sums (R, K) of the targets' costs of which the largest counts, and what each is relative to (R,) [σ].

    Of a group of two the facets of its cone: √(a² + b²) is the largest of a cos φ + b sin φ; of `FACETS` φ it is so to
    half a percent. Of a larger group the tangent plane at the present costs.
    """
    angle, value = np.linspace(0.0, 0.5 * np.pi, FACETS), here.ratio * task.best
    rows, most = [], []
    for group, least in zip(task.groups, task.least, strict=True):
        own = value[list(group)]
        facets = np.column_stack([np.cos(angle), np.sin(angle)]) if len(group) == 2 else own[None] / hypot(*own)
        row = np.zeros((len(facets), len(value)))
        row[:, list(group)] = facets
        rows.append(row)
        most += [least] * len(facets)
    return np.concatenate(rows), np.array(most)


def _by_angles(task: Task, here: Costs) -> NDArray:
    """Derivatives (K, 2 N, P) of Σ Φ F by the angles, at the present weights."""
    places, given = here.places, here.readings
    alpha, beta = places.angle[given.position].T
    f = task.regressor[given.sheet]
    ways = ((slopes(alpha), basis(beta)), (basis(alpha), slopes(beta)))
    by = np.stack([np.einsum("mpij,mi,mj->mp", f, a, b, optimize=True) for a, b in ways], axis=1)
    moved = np.zeros((len(places), len(here.weights), *by.shape[1:]))
    np.add.at(moved, given.position, here.weights.T[..., None, None] * by[:, None])
    return moved.transpose(1, 0, 2, 3).reshape(len(here.weights), 2 * len(places), -1)


def _boundary(task: Task, sheet: NDArray, angle: NDArray) -> tuple[NDArray, NDArray]:
    """Base and terms (M, 1 + T) of the clearances of sheets (M,) at angles (M, 2), and their slopes (M, 1 + T, 2)."""
    forms = np.concatenate([task.base[sheet][:, None], task.terms[sheet]], axis=1)
    (alpha, beta), (by_alpha, by_beta) = map(basis, angle.T), map(slopes, angle.T)
    at, *by = (
        np.einsum("mtij,mi,mj->mt", forms, a, b, optimize=True)
        for a, b in ((alpha, beta), (by_alpha, beta), (alpha, by_beta))
    )
    return at, np.stack(by, axis=2)


def _edges(task: Task, here: Costs, kept: NDArray, radius: float) -> tuple[NDArray, NDArray]:
    """Linear conditions (E, 2 N) on the moves, at least (E,), that keep readings near the boundary inside it."""
    sheets, positions = here.readings.sheet[kept], here.readings.position[kept]
    there = [_boundary(task, sheets, here.places.angle[positions] + shift) for shift in task.shifts]
    rows, least = [], []
    for m, (sheet, position) in enumerate(zip(sheets, positions, strict=True)):
        for values, lines in there:
            value, slope = values[m], lines[m]
            reach = np.abs(slope).sum(axis=1) * radius
            clear = value[0] - np.abs(value[1:]).sum() - task.room[sheet]
            if clear > 2.0 * reach.sum():
                continue
            sign = np.where(value >= 0.0, 1.0, -1.0)
            open_terms = [t for t in range(1, len(value)) if abs(value[t]) <= reach[t] and reach[t] > 0.0][:3]
            for turned in product((1.0, -1.0), repeat=len(open_terms)):
                signs = sign.copy()
                signs[open_terms] *= turned
                signs[0] = -1.0
                row = np.zeros_like(here.places.angle)
                row[position] = -(signs[:, None] * slope).sum(axis=0)
                rows.append(row.ravel())
                least.append(INSIDE + float((signs * value).sum()) + task.room[sheet])
    return np.array(rows).reshape(len(rows), here.places.angle.size), np.array(least)


def _mended(task: Task, here: Costs, angle: NDArray) -> NDArray:
    """Angles after a step, moved back where readings that carry weight have just ceased to count."""
    angle = angle.copy()
    used = np.flatnonzero((np.abs(here.weights) > NO_WEIGHT).any(axis=0))
    position, sheet = here.readings.position[used], here.readings.sheet[used]
    for _ in range(MENDINGS):
        lines: dict[int, list[tuple[NDArray, float]]] = {}
        for shift in task.shifts:
            value, slope = _boundary(task, sheet, angle[position] + shift)
            signs = np.where(value >= 0.0, -1.0, 1.0)
            signs[:, 0] = 1.0
            clear = (signs * value).sum(axis=1) - task.room[sheet]
            line = (signs[..., None] * slope).sum(axis=1)
            for m in np.flatnonzero((clear < 0.5 * INSIDE) & (clear > -0.02)):
                lines.setdefault(int(position[m]), []).append((line[m], INSIDE - float(clear[m])))
        if not lines:
            break
        for where, found in lines.items():
            matrix, missing = np.array([line for line, _ in found]), np.array([amount for _, amount in found])
            angle[where] += np.linalg.lstsq(matrix, missing, rcond=1e-8)[0]
    return angle
