"""Cells of an unknown number: times and time constants, without a gap."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from effect_readings import HOURS, G, extended_instance, readings, true_bench
from generator.positions import SIGMA, drawn_record
from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace, Rows
from trihedron.models.effects.last_stage import LAST_HOUR
from trihedron.models.effects.wander import wander_at
from trihedron.tools.bounded import Work
from trihedron.tools.calibration import predicted_reading
from trihedron.tools.evidence import CellsAtRest, acted_on, beginnings, bench_evidence, lagged
from trihedron.tools.evidence.cells import BEFORE, LONGEST, time_constants

SLOW, FAST = 3.0, 0.02
SEARCHED = [name for name, effect in POSITION_EFFECTS.items() if effect.searched is not None]


def drawn(seed: int) -> tuple[np.random.Generator, np.ndarray, np.ndarray]:
    """Return a generator, hours (N,) of rows, and a temperature (N,) that wanders."""
    rng = np.random.default_rng([seed, 41])
    hours = np.cumsum(rng.uniform(0.005, 0.05, int(rng.integers(8, 60))))
    return rng, hours - hours[0], 20.0 + np.cumsum(rng.normal(0.0, 1.0, len(hours)))


def drawn_rows(seed: int) -> tuple[np.random.Generator, Rows]:
    """Return a generator, and rows with inputs, derivatives by slips and a temperature."""
    rng, hours, temperature = drawn(seed)
    n = rng.uniform(-1.0, 1.0, (len(hours), 3))
    slopes = rng.uniform(-1.0, 1.0, (len(hours), 3, 3))
    return rng, Rows(hours, hours, hours, n, n, n, by_slip=slopes, temperature=temperature)


def missed_within(name: str, rng: np.random.Generator, rows: Rows, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the kernel's change for a number in a cell, less the span of its columns (N, 3), and the allowed miss."""
    place = POSITION_EFFECTS[name].places[-1]
    cells = CellsAtRest(place, rows)
    cell = cells[int(rng.integers(len(cells)))]
    (low, high), steps = cell.ends, cell.missed is None
    if not steps:
        low, high = cell.numbers[[0, -1]]
    number = (1.0 - share) * low + share * high if steps else low * (high / low) ** share
    weights = rng.normal(size=cell.columns.shape[2])
    if not steps:
        part = float(rng.random())
        of_beginnings = np.array([1.0]) if len(weights) == 2 else np.array([1.0 - part, part])
        weights = 1e-3 * np.outer([1.0 - share, share], of_beginnings).ravel()
    sizes = (cell.directions @ weights).tolist()
    if name == "mounting-slip":
        exact = rows.by_slip @ sizes * (rows.hours > number)[:, None]
    else:
        exact = acted_on([(place, (*sizes, number))], replace(rows, own=rows.n), np.zeros_like(rows.n))
    allowed = np.zeros_like(exact) if cell.missed is None else cell.missed @ np.abs(weights)
    return np.abs(exact - cell.columns @ weights), allowed


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**20), share=st.floats(0.0, 0.999))
@pytest.mark.parametrize("name", SEARCHED)
def test_no_number_is_missed_what_the_kernel_adds_lies_in_its_cell(name, seed, share):
    rng, rows = drawn_rows(seed)
    off, allowed = missed_within(name, rng, rows, share)
    assert np.all(off <= allowed + 1e-12)


@pytest.mark.parametrize(("name", "part"), [("warm-up", 0.95), ("thermal-lag", 0.3)])
def test_what_a_cell_may_miss_is_nearly_attained_and_small(name, part):
    nearest, size = 0.0, []
    for seed in range(40):
        rng, rows = drawn_rows(seed)
        off, allowed = missed_within(name, rng, rows, 0.5)
        nearest = max(nearest, float((off[:, -1] / np.maximum(allowed[:, -1], 1e-12)).max()))
        size.append(float(allowed.max()))
    assert nearest > part
    # The cost is small: a hundredth of the addition.
    assert max(size) < (1e-5 if name == "warm-up" else 2e-4)


def test_the_cells_cover_all_constants_that_a_record_shows_and_beginnings_of_a_lag():
    _, hours, temperature = drawn(3)
    ends, ahead = time_constants(hours), beginnings(temperature)
    assert ends[0] <= hours[2] * (1.0 + 1e-12)
    assert ends[-1] >= LONGEST * hours[-1] * (1.0 - 1e-12)
    # Half the range beyond it, on both sides.
    assert np.ptp(ahead) == pytest.approx(2.0 * np.ptp(temperature))
    assert temperature[0] + ahead.mean() == pytest.approx(0.5 * (temperature.min() + temperature.max()))


@pytest.mark.first(1)
@settings(max_examples=2, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**20), part=st.floats(0.12, 0.88))
@pytest.mark.parametrize("name", ["bias-step", "scale-step", "warm-up"])
def test_a_truth_at_any_number_is_within_the_intervals_of_cells_that_stand(name, seed, part):
    """Errors are at their bounds; independent code makes the records."""
    place = POSITION_EFFECTS[name].places[-1]
    hours = drawn_record(seed).time_s / 3600.0
    number = part * float(hours[-1] - hours[0])
    values = 60.0 * SIGMA, number
    evidence = bench_evidence(drawn_record(seed, [(place, values)], at_bound=True), noise_bound=SIGMA)
    fits = evidence.model.mended([place], Work())
    constant_rows = []
    for fit in fits:
        ends = evidence.reader.told(place, fit.intervals(evidence.model.room)[0])
        constant_rows.append(all(low <= value <= high for value, (low, high) in zip(values, ends, strict=True)))
    assert any(constant_rows)


@pytest.mark.parametrize("constant", [SLOW, 0.2, FAST])
def test_the_lag_of_a_record_is_that_of_the_differential_equation(constant):
    _, hours, temperature = drawn(11)

    def slope(time, lag):
        return (np.interp(time, hours, temperature) - lag) / constant

    solution = solve_ivp(slope, (0.0, hours[-1]), temperature[:1], t_eval=hours, max_step=2e-3, rtol=1e-9)
    assert lagged(hours, temperature, np.array([constant]))[0][:, 0] == pytest.approx(solution.y[0], abs=2e-3)


@pytest.mark.parametrize("constant", [SLOW, 0.2, FAST])
def test_the_component_remembers_the_temperature_as_the_cells_say(constant):
    """Steps of different lengths, a temperature that goes up and down; the lag is kept over them."""
    _, hours, temperature = drawn(12)
    place = EffectPlace("thermal-lag", "accelerometer-2")
    block = extended_instance("AccelerometerBlock", {place: (1e-3, 2e-4, constant)})
    plain = extended_instance("AccelerometerBlock", {})
    force = np.array([1.0, -4.0, 8.0])
    lag = []
    for instance in (block, plain):
        instance.put(temperature=temperature[0], specific_force=force).begin()
    for row in range(1, len(hours)):
        acted = [
            instance.put(temperature=temperature[row], specific_force=force).step(
                3600.0 * hours[row - 1], 3600.0 * (hours[row] - hours[row - 1])
            )["reading"]
            / G
            for instance in (block, plain)
        ]
        lag.append(acted[0] - acted[1])
    added = np.array(lag)
    assert not added[:, [0, 2]].any()
    expected = lagged(hours, temperature, np.array([constant]))[0][1:, 0]
    settling = 2e-4 * np.exp(-hours[1:] / constant)
    assert added[:, 1] == pytest.approx(1e-3 * (expected - 20.0) + settling, abs=1e-13)


@pytest.mark.parametrize("name", ["warm-up", "thermal-lag"])
def test_a_cell_adds_what_the_effect_does_at_the_ends_of_its_cell(name):
    _, hours, temperature = drawn(13)
    nothing = np.zeros((len(hours), 3))
    rows = Rows(hours, hours, hours, nothing, nothing, nothing, temperature=temperature)
    place = EffectPlace(name, "accelerometer-3")
    cells = list(CellsAtRest(place, rows))
    assert (cells[0].ends[0], cells[-1].ends[1]) == (0.0, LAST_HOUR)
    for cell in (cells[0], cells[len(cells) // 2], cells[-2]):
        constant = cell.ends[1]
        sizes = np.array([0.0, 2e-3]) if name == "warm-up" else np.array([0.0, 0.0, 5e-4, 1.5e-3])
        size, *settling, last = cell.values(sizes)
        added = cell.columns @ sizes
        assert (size, last) == pytest.approx((2e-3, constant))
        by_hand = 2e-3 * (1.0 - np.exp(-hours / constant))
        if name == "thermal-lag":
            # The lag may begin half the range of the temperatures below all of them, or above.
            far = temperature.max() - temperature.min()
            low, high = temperature.min() - BEFORE * far, temperature.max() + BEFORE * far
            begun = 0.25 * low + 0.75 * high - temperature[0]
            assert settling == pytest.approx([2e-3 * begun])
            steady = lagged(hours, temperature - 20.0, np.array([constant]))[0][:, 0]
            by_hand = 2e-3 * (steady + begun * np.exp(-hours / constant))
        assert added[:, 2] == pytest.approx(by_hand, abs=1e-15)
        assert not added[:, :2].any()
    lengths = [cell.ends for cell in cells]
    assert all(a[1] == b[0] for a, b in pairwise(lengths))


def test_a_slip_of_the_mounting_is_exact_in_the_model_and_told_by_its_columns_to_first_order():
    place = EffectPlace("mounting-slip", "mounting")
    start, size = 0.5 * (HOURS[2] + HOURS[3]), np.array([4e-3, -6e-3, 5e-3])
    (bench, rows), acted = true_bench(), readings({place: (*size, start)})
    (cells,) = (cell for cell in CellsAtRest(place, rows) if cell.ends == (HOURS[2], HOURS[3]))
    assert cells.values(size) == pytest.approx((*size, start))
    first_order = rows.prediction + cells.columns @ size
    assert 1e-6 < np.abs(first_order - acted).max() < size @ size
    at = replace(bench.positions, slips=np.where((start < HOURS)[:, None], size, 0.0))
    assert predicted_reading(bench.parametrisation, bench.point, at) == pytest.approx(acted, abs=2e-14)


@pytest.mark.parametrize(
    "place", [*CATALOGUE["bias-step"].places, *CATALOGUE["scale-step"].places], ids=lambda place: place.title
)
def test_a_step_of_bias_or_scale_is_one_of_the_cells_from_its_time_on(place):
    start, size = 0.5 * (HOURS[2] + HOURS[3]), 3e-3
    rows, acted = true_bench()[1], readings({place: (size, start)})
    every = CellsAtRest(place, rows)
    cells = [cell for cell in every if cell.ends[0] <= start <= cell.ends[1]]
    assert len(cells) == 1
    assert cells[0].ends == (HOURS[2], HOURS[3])
    assert rows.prediction + cells[0].columns @ np.array([size]) == pytest.approx(acted, abs=1e-14)
    assert cells[0].values(np.array([size])) == pytest.approx((size, start))
    # Two rows at least on each side.
    assert [cell.ends for cell in every] == list(pairwise(HOURS[1:-1]))
    within = replace(rows, hours=np.linspace(HOURS[2], HOURS[3], len(HOURS)))
    assert np.array_equal(cells[0].undecided(within, 1e-5).any(axis=1), [0, 1, 1, 1, 1, 1, 0])


def test_a_wander_is_straight_between_its_times_and_zero_at_the_first():
    place = EffectPlace("bias-wander", "accelerometer-1", law="hours at 0.0 0.5 2.0")
    effect = wander_at(place)
    hours = np.array([0.0, 0.25, 0.5, 1.25, 2.0, 3.0])
    nothing = np.zeros((len(hours), 3))
    columns = effect.signature(place, Rows(hours, hours, hours, nothing, nothing, nothing))
    added = (columns @ np.array([1e-3, -2e-3]))[:, 0]
    assert added == pytest.approx([0.0, 5e-4, 1e-3, -5e-4, -2e-3, -2e-3])
    block = extended_instance("AccelerometerBlock", {place: (1e-3, -2e-3)})
    plain = extended_instance("AccelerometerBlock", {})
    for instance in (block, plain):
        instance.put(temperature=20.0, specific_force=np.ones(3)).begin()
    acted = [instance.step(0.0, 3600.0 * 1.25)["reading"] for instance in (block, plain)]
    assert (acted[0] - acted[1]) / G == pytest.approx([-5e-4, 0.0, 0.0], abs=1e-14)
    assert "wanders over 3.00e-03 g, by up to 2.00e-03 g an hour" in effect.sentence(
        place, {"value_2": 1e-3, "value_3": -2e-3}
    )
    for law in ("n1 at 0 1", "hours jumps at 0.3", "n1 times hours at 0 1"):
        with pytest.raises(ValueError, match="wanders by 'hours at knots'"):
            wander_at(EffectPlace("bias-wander", "accelerometer-1", law=law))


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("thermal-lag", (-9.3e-4, -3.2e-3, 0.09)),
        ("thermal-lag", (9.0e-4, 1e-3, 0.06)),
        ("warm-up", (0.095, 0.3)),
        ("warm-up", (-0.09, 0.15)),
    ],
)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.acceptance) for seed in range(1, 8))])
def test_a_truth_near_the_largest_size_is_within_the_intervals(name, sizes, seed):
    """The best size of a cell is beyond the largest, and a possible one explains the record, too."""
    place = EffectPlace(name, "accelerometer-2")
    record = drawn_record(seed, [(place, sizes)], 22, temperature=True)
    model = bench_evidence(record, noise_bound=SIGMA).model
    covered = []
    for fit in model.mended([place], Work()):
        (intervals,) = fit.intervals(model.room)
        covered.append(all(low <= size <= high for size, (low, high) in zip(sizes, intervals, strict=True)))
    assert any(covered)
