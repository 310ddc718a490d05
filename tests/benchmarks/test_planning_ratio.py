"""Column generation against the full linear programme in HiGHS, and the time of proofs, in one run."""

import resource
import subprocess
import sys
import time

import highspy
import numpy as np
import pytest

from planning_reference import random_mounting
from trihedron.models.bench import TARGETS, admissible, regressors
from trihedron.tools.planning import optimal_plans


def full_columns() -> np.ndarray:
    """Return F (K, 18) in the paper's X of every admissible reading of the 1° grid over [0°, 360°]², as the tables."""
    angle = np.radians(np.arange(361))
    alpha, beta = (g.ravel() for g in np.meshgrid(angle, angle, indexing="ij"))
    retained = admissible(alpha, beta, np.eye(3), rule="tables")
    return regressors(alpha, beta, np.eye(3))[retained]


def full_cost(columns: np.ndarray, target: np.ndarray) -> tuple[float, float]:
    """Return min Σ|Φ| with Σ Φ F = a over all columns, in HiGHS with its own choices; the cost and the seconds."""
    began = time.perf_counter()
    pair = np.vstack([columns, -columns])
    which, rows = np.nonzero(pair)
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = pair.shape
    lp.col_cost_, lp.col_lower_ = np.ones(len(pair)), np.zeros(len(pair))
    lp.col_upper_ = np.full(len(pair), highspy.kHighsInf)
    lp.row_lower_ = lp.row_upper_ = target
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_ = np.searchsorted(which, np.arange(len(pair) + 1)).astype(np.int32)
    lp.a_matrix_.index_, lp.a_matrix_.value_ = rows.astype(np.int32), pair[which, rows]
    highs = highspy.Highs()
    for name, option in (("output_flag", False), ("primal_feasibility_tolerance", 1e-10)):
        highs.setOptionValue(name, option)
    highs.setOptionValue("dual_feasibility_tolerance", 1e-10)
    highs.passModel(lp)
    highs.run()
    return highs.getInfo().objective_function_value, time.perf_counter() - began


def target_in_x(symbol: str) -> np.ndarray:
    a = np.zeros(18)
    for part in symbol.replace("-", "+-").split("+"):
        if part:
            a[int(part.lstrip("-X")) - 1] = -1.0 if part.startswith("-") else 1.0
    return a


@pytest.mark.benchmark_ratio
def test_all_targets_on_the_one_degree_grid(capsys: pytest.CaptureFixture[str]) -> None:
    ours, busy = [], []
    for _ in range(3):
        began, busy_before = time.perf_counter(), time.process_time()
        plans = optimal_plans(admissible="tables")
        ours.append(time.perf_counter() - began)
        busy.append(time.process_time() - busy_before)
    columns = full_columns()
    full = [full_cost(columns, target_in_x(target)) for target in TARGETS]
    for plan, (cost, _) in zip(plans, full, strict=True):
        assert plan.cost == pytest.approx(cost, abs=1e-9), plan.target
    seconds = sum(s for _, s in full)
    with capsys.disabled():
        print(
            f"\n18 targets, 1° grid, {len(columns)} readings: full programme in HiGHS {seconds:.1f} s, "
            f"column generation {min(ours):.2f} s ({min(busy):.2f} s of processor), ratio {seconds / min(ours):.0f}"
        )
    assert seconds / min(ours) >= 100
    assert min(busy) < 1.0


def processor(*command: str) -> float:
    """Return the least of three times of a whole Python process [s of processor]."""

    def used() -> float:
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return children.ru_utime + children.ru_stime

    times = []
    for _ in range(3):
        before = used()
        subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL)
        times.append(used() - before)
    return min(times)


@pytest.mark.benchmark_ratio
@pytest.mark.parametrize(("options", "most"), [((), 3.0), (("--continuum",), 7.0)])
def test_a_whole_process_against_one_that_only_imports(
    options: tuple[str, ...], most: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """Compute 18 plans from the command line, in units of the start-up of Python, NumPy and SciPy."""
    unit = processor("-c", "import numpy, scipy.optimize")
    ours = processor("-m", "trihedron.tools.cli", "plan", "target", *options)
    with capsys.disabled():
        print(f"\nplan {' '.join(options)}: {ours:.2f} s of processor, {ours / unit:.1f} times the imports of SciPy")
    assert ours < most * unit


@pytest.mark.benchmark_ratio
@pytest.mark.parametrize(("name", "limit"), [("identity", 4.0), ("random", 10.0)])
def test_certified_optima_over_all_angles(name: str, limit: float, capsys: pytest.CaptureFixture[str]) -> None:
    matrix = np.eye(3) if name == "identity" else random_mounting(1)
    began = time.process_time()
    plans = optimal_plans(grid=None, mounting={name: matrix})
    seconds = time.process_time() - began
    gap = max(plan.gap for plan in plans)
    with capsys.disabled():
        print(f"\n18 targets, all angles, {name} mounting: {seconds:.1f} s of processor, largest proven gap {gap:.1e}")
    assert gap <= 1e-9
    assert seconds < limit


@pytest.mark.benchmark_ratio
def test_a_grid_of_a_tenth_of_a_degree(capsys: pytest.CaptureFixture[str]) -> None:
    began = time.process_time()
    plans = optimal_plans(grid=0.1)
    seconds = time.process_time() - began
    with capsys.disabled():
        print(f"\n18 targets, 0.1° grid, 13 million positions: {seconds:.1f} s of processor")
    assert max(plan.gap for plan in plans) <= 1e-9
