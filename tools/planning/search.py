"""Search for the best common set of positions.

Many starts are improved locally, and the best ones changed in part. Local improvement is sequential linear programming
in the angles and all weights at once. Unknowns are the angles θ and the weights Φ of every target's estimator: least r
with Σ Φ F(θ) = a and Σ|Φ| ≤ r c. About the present weights the products Φ F(θ) are linear in dθ and the new Φ, to
second order; readings that count must continue to count. A step is taken if the exact costs fall, and its success sets
the next radius of trust.

Random numbers come from the seed, and the budget is counted in starts: the same options find the same plan.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import product

import highspy
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, block_diag, csc_array

from ..bounded.programmes import UNSCALED, Solver, linear_programme
from ..progress import progress_bar
from ..rounding import upwards
from .certificate import NO_WEIGHT
from .forms import harmonics, slopes
from .task import NOT_DETERMINED, Costs, Places, Task, allowed, costs, free_arcs, freedom

BEST_SETS = 6
"""Number of best sets that are kept and changed."""
ALIKE = 1e-6
"""Sets whose merit differs by less count as one."""
FRESH = 0.2
"""Share of starts that begin anew if there are sets to change."""
DRAWS = 6
"""Number of random sets from which the best one is improved."""
SPREAD_DEG = 8.0
"""Spread of a start about the axes' multiples of 90° [deg]."""
GIVE_UP = ((8, 0.05), (15, 0.01))
"""Steps, and the largest distance from the best sets after them, relative to their own loss; beyond it, give up."""
REDRAWS = 200
FACETS = 9
"""Number of facets of a quarter of the cone of a level's error."""
LITTLE = 1e-3
"""Weight of the mean ratio beside the worst: it breaks ties."""
MOST_STEPS = 40
WIDE, FINEST = 0.3, 1e-7
"""Largest and least radius of trust [rad]."""
NEAR_ONE = 0.35
"""Distance of |F'y| below one beyond which columns do not enter a step's programme."""
INSIDE = 2e-10
"""Clearance [g] that a step leaves to readings on the boundary."""
GAIN = 1e-10
SMALL_GAIN, SMALL_STEPS = 1e-6, 4
"""An improvement ends after this number of consecutive steps with less than this gain."""
SOLVER_OPTIONS: dict[str, str | int | bool] = {
    "output_flag": False,
    "threads": 1,
    "parallel": "off",
    "solver": "simplex",
    "presolve": "off",
    "simplex_scale_strategy": UNSCALED,
    "simplex_dual_edge_weight_strategy": 1,
}
"""Options for a step's programme, which is small and well scaled: half the time without presolve and scaling."""
MENDINGS = 6
SWEEPS = 6
"""Number of rounds in which each position of a rounded set may move by one step."""


@dataclass
class BestSets:
    """The best sets so far, the best first, each with its merit; no two are alike."""

    merits: list[float] = field(default_factory=list)
    sets: list[Costs] = field(default_factory=list)

    def add(self, value: float, candidate: Costs) -> None:
        """Insert a set, unless one of the same merit is there or all are better."""
        if any(abs(value - merit) <= ALIKE for merit in self.merits):
            return
        place = int(np.searchsorted(self.merits, value, side="right"))
        self.merits.insert(place, value)
        self.sets.insert(place, candidate)
        del self.merits[BEST_SETS:], self.sets[BEST_SETS:]

    @property
    def full(self) -> bool:
        """True if the list has its full length."""
        return len(self.sets) == BEST_SETS

    @property
    def best(self) -> Costs | None:
        """Best set, if it determines all targets."""
        return self.sets[0] if self.sets and self.sets[0].complete else None

    def beyond_reach(self, step: int, value: float) -> bool:
        """Return True if an improvement of this merit after this number of steps will hardly get among these sets."""
        if not self.full:
            return False
        room = max(1.0, self.merits[-1] - 1.0)
        return any(step == steps and value > self.merits[-1] + share * room for steps, share in GIVE_UP)


def search_positions(
    task: Task, count: int, *, beginnings: Sequence[Places] = (), enough: float = 0.0, progress: bool = False
) -> tuple[Costs | None, int, bool]:
    """Search the best set of this number of positions; Ctrl-C ends the search and keeps the best so far, if any.

    Parameters
    ----------
    task : Task
        its request has the criterion, the number of starts, and the seed of the random numbers
    count : int
        number of positions
    beginnings : sequence of Places
        sets to begin with, beside the random ones
    enough : float
        worst ratio at which the search ends
    progress : bool
        show a bar on standard error

    Returns
    -------
    best : Costs or None
        None if no set was found that determines all targets
    starts : int
        local improvements that were made
    interrupted : bool
        True if Ctrl-C ended the search before its budget was spent
    """
    rng, starts = np.random.default_rng(task.request.seed), task.request.starts
    best_sets, improved = BestSets(), 0
    with progress_bar(f"{count} positions", len(beginnings) + starts, show=progress) as advance:
        try:
            for number in range(len(beginnings) + starts):
                if number < len(beginnings):
                    start = costs(task, beginnings[number])
                else:
                    start = _start(task, count, rng, best_sets)
                better = improve(task, start, best_sets=best_sets)
                improved += 1
                best_sets.add(merit(task, better), better)
                best = best_sets.best
                advance(1, None if best is None else f"{count} positions, ratio {upwards(best.worst, 6)}")
                if best is not None and best.worst <= enough:
                    break
        except KeyboardInterrupt:
            if not best_sets.sets:
                raise
            return best_sets.best, improved, True
    return best_sets.best, improved, False


def _start(task: Task, count: int, rng: np.random.Generator, best_sets: BestSets) -> Costs:
    """Return a set to improve: random, or one of the best with one or two positions drawn anew."""
    trials = []
    if not best_sets.full or rng.random() < FRESH:
        for _ in range(DRAWS):
            trials.append(costs(task, random_places(task, count, rng).joined(task.measured)))
    else:
        base = best_sets.sets[int(rng.integers(BEST_SETS))].places
        for _ in range(2):
            rows = rng.choice(count, min(count, int(rng.integers(1, 3))), replace=False)
            new = random_places(task, len(rows), rng)
            angle, mounting = base.angle.copy(), base.mounting.copy()
            angle[rows], mounting[rows] = new.angle, new.mounting
            trials.append(costs(task, Places(angle, mounting)))
    return min(trials, key=lambda trial: (min(trial.worst, NOT_DETERMINED), trial.mean))


def random_places(task: Task, count: int, rng: np.random.Generator) -> Places:
    """Return random positions outside the keep-outs: anywhere, or near multiples of 90° of both axes."""
    if rng.integers(2):
        angle = np.radians(90.0 * rng.integers(0, 4, (count, 2)) + rng.normal(0.0, SPREAD_DEG, (count, 2)))
    else:
        angle = rng.uniform(0.0, 2.0 * np.pi, (count, 2))
    for _ in range(REDRAWS):
        wrong = ~allowed(task, angle)
        if not wrong.any():
            break
        angle[wrong] = rng.uniform(0.0, 2.0 * np.pi, (int(wrong.sum()), 2))
    else:
        wrong = ~allowed(task, angle)
        angle[wrong] = _free_angles(task, int(wrong.sum()), rng)
    return Places(angle, rng.integers(0, len(task.parametrisation.mountings), count))


def _free_angles(task: Task, count: int, rng: np.random.Generator) -> NDArray:
    """Return random angles outside large keep-outs: an arc chosen by its width, then any point on it."""
    angle = np.zeros((count, 2))
    for axis, intervals in enumerate(task.keep_out):
        low, high = np.array(free_arcs(intervals)).T
        arc = rng.choice(len(low), count, p=(high - low) / (high - low).sum())
        angle[:, axis] = rng.uniform(low[arc], high[arc])
    return angle


def merit(task: Task, candidate: Costs) -> float:
    """Return the merit to minimise: the worst ratio plus a little of the mean, or the mean plus a little of the worst.

    For a goal the worst ratio is that of its error.
    """
    if task.request.criterion == "mean":
        return candidate.mean + LITTLE * candidate.worst
    return candidate.worst + LITTLE * candidate.mean


def improve(task: Task, start: Costs, *, radius: float = WIDE, best_sets: BestSets | None = None) -> Costs:
    """Improve a set of positions until no small move helps; the result is never worse than the start.

    An angle may move by the radius [rad] in the first step. The improvement ends after several consecutive steps of
    little gain, and if its merit will hardly get among the best sets.
    """
    best, value, slow = start, merit(task, start), 0
    for number in range(MOST_STEPS):
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
                if gained > 0.5 * hoped:
                    radius *= 2.0
                elif gained < 0.1 * hoped:
                    radius *= 0.5
                radius = min(WIDE, radius)
            else:
                radius *= 0.3
        if radius < FINEST or slow >= SMALL_STEPS or (best_sets is not None and best_sets.beyond_reach(number, value)):
            break
    return best


def _step(task: Task, present: Costs, radius: float) -> tuple[NDArray, float] | None:
    """Return a step of the angles (N, 2) [rad] and the merit that the linear model predicts; None without a
    solution."""
    counted, (many, size) = present.readings, task.weights.shape
    lasting = (np.abs(present.weights) > NO_WEIGHT).any(axis=0) | (counted.clearance > 2.0 * radius)
    blocks = _column_blocks(present, lasting)
    sizes = [block.shape[1] for block in blocks]
    moved = _by_angles(task, present)
    moved = np.where(np.abs(moved) > 1e-13, moved, 0.0).transpose(0, 2, 1).reshape(many * size, -1)
    edges, least = _edges(task, present, np.flatnonzero(lasting), radius)
    sums, most = _error_rows(task, present)
    spread = csc_array(sums @ block_diag([np.ones((1, n)) for n in sizes]))
    matrix = csc_array(
        block_array([[block_diag(blocks), moved, None], [spread, None, -most[:, None]], [None, edges, None]])
    )
    down, up = freedom(task, present.places.angle, radius)
    weights, angles = sum(sizes), down.size
    worst = task.request.criterion == "worst"
    of_mean, of_worst = (LITTLE, 1.0) if worst else (1.0, LITTLE)
    model = linear_programme(
        np.concatenate([np.repeat(of_mean / many / task.best, sizes), np.zeros(angles), [of_worst]]),
        (
            np.concatenate([np.zeros(weights), -down.ravel(), [0.0]]),
            np.concatenate([np.full(weights, np.inf), up.ravel(), [np.inf]]),
        ),
        (matrix.indptr, matrix.indices, matrix.data),
        (
            np.concatenate([task.weights.ravel(), np.full(len(sums), -np.inf), least]),
            np.concatenate([task.weights.ravel(), np.zeros(len(sums)), np.full(len(least), np.inf)]),
        ),
    )
    highs = Solver()
    for name, option in SOLVER_OPTIONS.items():
        highs.setOptionValue(name, option)
    if highs.passModel(model) == highspy.HighsStatus.kError:
        return None
    highs.run()
    if highs.getModelStatus() != highspy.HighsModelStatus.kOptimal:
        return None
    move = np.array(highs.getSolution().col_value)[weights : weights + angles].reshape(down.shape)
    return move, float(highs.getInfo().objective_function_value)


def _column_blocks(present: Costs, lasting: NDArray) -> list[NDArray]:
    """Return for each target the columns (P, n) that may have weight after a step: F of either sign with |F'y| near
    one."""
    regressor = present.readings.regressor
    height = present.duals @ regressor.T
    near = lasting & ((np.abs(height) > 1.0 - NEAR_ONE) | (present.weights != 0.0))
    blocks = []
    for entering, values in zip(near, height, strict=True):
        either = np.abs(values) < 0.2
        plus, minus = entering & ((values > 0.0) | either), entering & ((values < 0.0) | either)
        blocks.append(np.hstack([regressor[plus].T, -regressor[minus].T]))
    return blocks


def _error_rows(task: Task, present: Costs) -> tuple[NDArray, NDArray]:
    """Return sums (R, K) of the targets' costs, whose largest counts, and their reference values (R,) [σ].

    A group of two gives the facets of its cone. √(a² + b²) is the largest of a cos φ + b sin φ, to half a percent with
    `FACETS` values of φ.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, FACETS)
    rows, most = [], []
    for group, least in zip(task.groups, task.least, strict=True):
        facets = np.ones((1, 1))
        if len(group) == 2:
            facets = np.column_stack([np.cos(angle), np.sin(angle)])
        row = np.zeros((len(facets), len(task.best)))
        row[:, list(group)] = facets
        rows.append(row)
        most += [least] * len(facets)
    return np.concatenate(rows), np.array(most)


def _by_angles(task: Task, present: Costs) -> NDArray:
    """Return derivatives (K, 2 N, P) of Σ Φ F by the angles, at the present weights."""
    places, counted = present.places, present.readings
    alpha, beta = places.angle[counted.position].T
    f = task.regressor[counted.sheet]
    by_alpha = np.einsum("mpij,mi,mj->mp", f, slopes(alpha), harmonics(beta), optimize=True)
    by_beta = np.einsum("mpij,mi,mj->mp", f, harmonics(alpha), slopes(beta), optimize=True)
    by = np.stack([by_alpha, by_beta], axis=1)
    targets = len(present.weights)
    moved = np.zeros((len(places), targets, 2, f.shape[1]))
    np.add.at(moved, counted.position, present.weights.T[..., None, None] * by[:, None])
    return moved.transpose(1, 0, 2, 3).reshape(targets, 2 * len(places), -1)


def _boundary(task: Task, sheet: NDArray, angle: NDArray) -> tuple[NDArray, NDArray]:
    """Return base and terms (M, 1 + T) of the clearances of sheets (M,) at angles (M, 2), and their slopes (M, 1 +
    T, 2)."""
    forms = np.concatenate([task.base[sheet][:, None], task.terms[sheet]], axis=1)
    alpha, beta = harmonics(angle[:, 0]), harmonics(angle[:, 1])
    values = np.einsum("mtij,mi,mj->mt", forms, alpha, beta, optimize=True)
    by_alpha = np.einsum("mtij,mi,mj->mt", forms, slopes(angle[:, 0]), beta, optimize=True)
    by_beta = np.einsum("mtij,mi,mj->mt", forms, alpha, slopes(angle[:, 1]), optimize=True)
    return values, np.stack([by_alpha, by_beta], axis=2)


def _edges(task: Task, present: Costs, lasting: NDArray, radius: float) -> tuple[NDArray, NDArray]:
    """Return linear conditions (E, 2 N) on the moves, at least (E,), that keep readings near the boundary inside it."""
    sheets, positions = present.readings.sheet[lasting], present.readings.position[lasting]
    corners = [_boundary(task, sheets, present.places.angle[positions] + shift) for shift in task.shifts]
    rows, least = [], []
    for m, (sheet, position) in enumerate(zip(sheets, positions, strict=True)):
        for values, lines in corners:
            value, slope = values[m], lines[m]
            reach = np.abs(slope).sum(axis=1) * radius
            clear = value[0] - np.abs(value[1:]).sum() - task.room[sheet]
            if clear > 2.0 * reach.sum():
                continue
            for signs in _open_signs(value, reach):
                row = np.zeros_like(present.places.angle)
                row[position] = -(signs[:, None] * slope).sum(axis=0)
                rows.append(row.ravel())
                least.append(INSIDE + float((signs * value).sum()) + task.room[sheet])
    return np.array(rows).reshape(len(rows), present.places.angle.size), np.array(least)


def _open_signs(value: NDArray, reach: NDArray) -> list[NDArray]:
    """Return all signs (1 + T,) of minus the base and of the terms that are possible after a step of that reach."""
    sign = np.where(value >= 0.0, 1.0, -1.0)
    near = np.flatnonzero((np.abs(value) <= reach) & (reach > 0.0))
    near = near[near > 0][:3]
    ways = []
    for turned in product((1.0, -1.0), repeat=len(near)):
        signs = sign.copy()
        signs[near] *= turned
        signs[0] = -1.0
        ways.append(signs)
    return ways


def _mended(task: Task, present: Costs, angle: NDArray) -> NDArray:
    """Return the angles after a step, moved back where readings with weight have just ceased to count."""
    angle = angle.copy()
    used = np.flatnonzero((np.abs(present.weights) > NO_WEIGHT).any(axis=0))
    position, sheet = present.readings.position[used], present.readings.sheet[used]
    for _ in range(MENDINGS):
        lines: dict[int, list[NDArray]] = {}
        amounts: dict[int, list[float]] = {}
        for shift in task.shifts:
            value, slope = _boundary(task, sheet, angle[position] + shift)
            signs = np.where(value >= 0.0, -1.0, 1.0)
            signs[:, 0] = 1.0
            clear = (signs * value).sum(axis=1) - task.room[sheet]
            line = (signs[..., None] * slope).sum(axis=1)
            for m in np.flatnonzero((clear < 0.5 * INSIDE) & (clear > -0.02)):
                lines.setdefault(int(position[m]), []).append(line[m])
                amounts.setdefault(int(position[m]), []).append(INSIDE - float(clear[m]))
        if not lines:
            break
        for row, matrix in lines.items():
            angle[row] += np.linalg.lstsq(np.array(matrix), np.array(amounts[row]), rcond=1e-8)[0]
    return angle


def rounded(task: Task, best: Costs) -> Costs:
    """Return the set with every angle a multiple of the table's resolution, chosen for least cost.

    One position after the other goes to the best of the four multiples around it, while the later ones keep their
    angles. Then each may move by one step, as long as that helps.
    """
    step_deg = task.request.resolution_deg
    assert step_deg is not None
    rows = range(len(best.places) - len(task.measured))
    for row in rows:
        low = np.floor(np.degrees(best.places.angle[row]) / step_deg)
        best = _best_of(task, best, row, step_deg * (low + np.array(list(product((0, 1), repeat=2)))))
    for _ in range(SWEEPS):
        before = merit(task, best)
        for row in rows:
            present = np.round(np.degrees(best.places.angle[row]) / step_deg)
            best = _best_of(task, best, row, step_deg * (present + np.array(list(product((0, -1, 1), repeat=2)))))
        if merit(task, best) >= before:
            break
    return best


def _best_of(task: Task, present: Costs, row: int, trials_deg: NDArray) -> Costs:
    """Return the best of the sets with one position at each of some angles (T, 2) [deg] outside the keep-outs."""
    angles = np.repeat(present.places.angle[None], len(trials_deg), axis=0)
    angles[:, row] = np.radians(trials_deg)
    inside = angles[allowed(task, angles[:, row])]
    if not len(inside):
        return costs(task, present.places.at(angles[0]))
    sets = [costs(task, present.places.at(angle)) for angle in inside]
    return min(sets, key=lambda trial: merit(task, trial))
