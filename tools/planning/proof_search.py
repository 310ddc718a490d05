"""Look for the certificate of `proof` that no N positions reach a ratio: a linear programme over cells, and its cuts.

The positions are a weight on the cells, N in all and alike on images under the symmetries. The programme makes the
least weight in any cut's region as great as it can; when that is below one, its prices are the weights of a certificate
with a single node. Cuts are looked for where the present answer has little weight in their region, from one y of each
target at once: steps down the gradient of the weight of the cells with |F'y| > 1, the step at 1 made ever steeper.

A cut that is found is only proposed: what holds is what `Proof.verify` says.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import solver
from .certificate import scaled_optimum
from .continuum import Continuum
from .forms import basis, clearance, sheets, x_from_targets
from .pool import symmetries
from .positions import Task, task_of
from .proof import Cut, Node, OptimalPlan, Proof, Reading
from .request import Request

QUARTER_DEG = (1.33, 2.6, 4.0, 6.0, 9.0, 13.0, 19.0, 26.0, 35.0, 45.0)
"""Lines between cells: narrow beside the multiples of 90°, where positions are to be."""
SAMPLES = np.linspace(0.0, 1.0, 13)
"""Where a cell's clearance is looked at, along each angle."""
STEPS, STEP = 50, 0.06
STEEP, AIM = (0.25, 0.008), 0.99
"""First and last width of the step at 1 of |F'y|, which stands a little lower."""
OTHERS = 900
"""So many cells without weight are looked at, too, drawn at random: a region is to be small there as well."""
DECIMALS = 5
WHOLE = 10**6
"""The weights that are less than its inverse are left out of the certificate."""
BELOW = 1e-5


class Cells:
    """The torus of both angles, divided: which sheets count where, F at corners and middles, groups of images."""

    def __init__(self, task: Task, quarter_deg: Sequence[float]):
        around = np.concatenate([-np.array(quarter_deg)[::-1], [0.0], quarter_deg[:-1]])
        low = np.radians((90.0 * np.arange(4)[:, None] + around).ravel())
        self.size = n = len(low)
        high = np.append(low[1:], low[0] + 2.0 * np.pi)
        self._half, middle = 0.5 * (high - low), 0.5 * (low + high)
        inside = (low[:, None] + (high - low)[:, None] * SAMPLES).ravel()
        self._regressor = task.regressor
        self._counts = np.stack(
            [
                clearance(sheet, inside[:, None], inside).reshape(n, len(SAMPLES), n, len(SAMPLES)).max(axis=(1, 3))
                > 0.0
                for sheet in sheets(task.parametrisation, bounds=task.request.bounds, rule=task.request.admissible)
            ]
        )
        corner, centre = basis(low), basis(middle)
        self._corners = np.einsum("spij,ai,bj->sabp", task.regressor, corner, corner, optimize=True)
        values = np.einsum("spij,ai,bj->sabp", task.regressor, centre, centre, optimize=True)
        # The middle stands for the whole cell, where F'y is greater by about as much.
        values *= (self._counts * (1.0 + 0.4 * (self._half[:, None] + self._half)))[..., None]
        self.rows = values.reshape(len(values), n * n, -1).astype(np.float32)
        moved = []
        for symmetry in symmetries(task):
            image = symmetry.of(np.column_stack([middle, middle]))
            a, b = (np.abs(np.exp(1j * x)[:, None] - np.exp(1j * middle)).argmin(axis=1) for x in image.T)
            moved.append((a[:, None] * n + b).ravel())
        _, self.orbit = np.unique(np.min(moved, axis=0), return_inverse=True)
        self.members = np.bincount(self.orbit)

    def region(self, y: NDArray) -> NDArray:
        """Which cells (n²,) |F'y| may exceed one in."""
        form = np.tensordot(self._regressor, y, axes=(1, 0))
        value = np.abs(self._corners @ y)
        value = np.maximum(value, np.roll(value, -1, axis=1))
        value = np.maximum(value, np.roll(value, -1, axis=2))
        a, b = (np.sqrt(2.0) * np.linalg.norm(part, 2, axis=(1, 2)) for part in (form[:, :2], form[:, :, :2]))
        bent = a[:, None, None] * self._half[:, None] ** 2 + b[:, None, None] * self._half**2
        return (self._counts & (value + 0.5 * bent > 1.0 - 1e-7)).any(axis=0).ravel()


def prove(
    count: int, ratio: float, *, rounds: int = 60, seed: int = 0, quarter_deg: Sequence[float] = QUARTER_DEG
) -> Proof | None:
    """A certificate, verified, that no `count` positions have a worst ratio below `ratio`; None where none is found.

    For the mounting `identity`, the default bounds, and the admissible set of the tables. An InputError where what was
    found does not hold.
    """
    task = task_of(Request(admissible="tables"))
    optima = _optimal_plans(task)
    aims = np.array([ratio * plan.cost for plan in optima])
    cells, rng, to_x = Cells(task, quarter_deg), np.random.default_rng(seed), x_from_targets()
    groups, whole = len(cells.members), cells.size**2
    programme = solver()
    programme.addVars(groups + 1, np.zeros(groups + 1), np.full(groups + 1, float(count)))
    programme.changeColCost(groups, -1.0)
    programme.addRow(float(count), float(count), groups, np.arange(groups, dtype=np.int32), np.ones(groups))
    found: list[tuple[int, NDArray]] = []
    least, share, mean = np.inf, count * cells.members / whole, np.full(whole, count / whole)
    for _ in range(rounds):
        answer = (share / cells.members)[cells.orbit]
        mean = 0.8 * mean + 0.2 * answer
        used = np.union1d(np.flatnonzero(answer > BELOW), rng.choice(whole, min(OTHERS, whole), replace=False))
        weight = 0.7 * answer[used] + 0.3 * mean[used] + 0.1 * count / len(used)
        start = 0.5 * rng.normal(size=(len(aims), task.weights.shape[1]))
        for k in np.flatnonzero(rng.random(len(aims)) < 0.5):
            if known := [y for target, y in found if target == k]:
                start[k] = known[rng.integers(len(known))] + 0.1 * rng.normal(size=start.shape[1])
        for k, y in enumerate(_descended(cells.rows[:, used], weight, start, aims)):
            y = np.round(y, DECIMALS)
            y[k] = np.ceil((aims[k] + 1e-8) * 10.0**DECIMALS) / 10.0**DECIMALS
            part = np.bincount(cells.orbit, cells.region(y), groups) / cells.members
            if part @ share < least - 10.0 * BELOW:
                inside = np.flatnonzero(part)
                columns = np.append(inside, groups).astype(np.int32)
                programme.addRow(0.0, np.inf, len(columns), columns, np.append(part[inside], -1.0))
                found.append((k, y))
        programme.run()
        solution = programme.getSolution()
        least, share = solution.col_value[groups], np.maximum(solution.col_value[:groups], 0.0)
        if least < 1.0 - BELOW:
            prices = np.rint(WHOLE * np.abs(solution.row_dual[1:])).astype(int)
            paid = np.flatnonzero(prices)
            proof = Proof(
                positions=count,
                ratio=ratio,
                bounds=task.request.bounds,
                admissible="tables",
                quarter_deg=tuple(quarter_deg),
                optima=optima,
                cuts=tuple(
                    Cut(target=optima[k].target, y=tuple(np.round(to_x @ y, DECIMALS).tolist()))
                    for k, y in (found[row] for row in paid)
                ),
                nodes=(Node(cuts=tuple((n, g, int(prices[row])) for n, row in enumerate(paid) for g in range(16))),),
            )
            proof.verify()
            return proof
    return None


def _descended(rows: NDArray, weight: NDArray, start: NDArray, aims: NDArray) -> NDArray:
    """y (K, P), each of the target in its place with y_k = aim, whose regions have little weight.

    The rows (S, n, P) are F of the cells with these weights (n,); a sheet that does not count is zero there.
    """
    flat, weight, each = rows.reshape(-1, rows.shape[2]), weight.astype(np.float32)[:, None], np.arange(len(aims))
    y = start.T.astype(np.float32)
    y[each, each] = aims
    first, second = np.zeros_like(y), np.zeros_like(y)
    for part in np.linspace(0.0, 1.0, STEPS):
        value = (flat @ y).reshape(*rows.shape[:2], -1)
        height = np.abs(value).max(axis=0)
        step = 1.0 / (
            1.0 + np.exp(-np.clip((height - AIM) / (STEEP[0] ** (1.0 - part) * STEEP[1] ** part), -15.0, 15.0))
        )
        pull = np.where(np.abs(value) == height, np.sign(value) * weight * step * (1.0 - step), 0.0)
        slope = flat.T @ pull.reshape(len(flat), -1)
        slope[each, each] = 0.0
        slope /= np.linalg.norm(slope, axis=0) + 1e-20
        first, second = 0.9 * first + 0.1 * slope, 0.98 * second + 0.02 * slope**2
        y -= STEP * 0.1**part * first / (np.sqrt(second) + 1e-3)
        y[each, each] = aims
    return y.T.astype(float)


def _optimal_plans(task: Task) -> tuple[OptimalPlan, ...]:
    everywhere = Continuum(sheets(task.parametrisation, bounds=task.request.bounds, rule=task.request.admissible))
    plans = []
    for target in task.targets:
        plan = scaled_optimum(everywhere.optimum, target.weights)
        rows = zip(plan.accelerometer + 1, np.degrees(plan.alpha), np.degrees(plan.beta), plan.weights, strict=True)
        readings = tuple(
            Reading(accelerometer=int(p), alpha_deg=float(a), beta_deg=float(b), weight=float(w)) for p, a, b, w in rows
        )
        cost = float(np.abs(plan.weights).sum()) + 5e-10
        plans.append(OptimalPlan(target=target.symbol, cost=cost, readings=readings))
    return tuple(plans)
