"""Attitude algorithms compared: on a record through the attitude computer's FMU, on motions with compiled kernels.

The update (22) in 32-bit arithmetic too: plain, carrying 1 - λ0*, compensated, and with pairs of 32-bit numbers. A pair
is an unevaluated sum of two 32-bit numbers; sums and products of pairs are the error-free ones of Knuth and Dekker,
made of 32-bit operations alone.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field

from ...fmus.instruments import GYRO_BLOCK
from ...fmus.source import instantiate
from ...models import gyro, harmonic_motion, rotation
from ...models.attitude_algorithms import ALGORITHMS, PRODUCTS, Algorithm
from ...models.attitude_algorithms.adaptive import adaptive_degree
from ...models.attitude_algorithms.computer import STEP_SIZE, TABLE_SIZE, prepare_update
from ...models.attitude_algorithms.iteration import (
    SPACE_SIZE,
    functional_iteration,
    rodrigues_iteration,
)
from ...models.attitude_algorithms.products import by_products, by_products_and_series, by_products_cut_off
from ...models.random_numbers import GENERATOR_SIZE, seed_generator
from ..compiled import Makers, compile_callee, compiled, local_array, loop_compiled, loops_over
from ..errors import InputError
from ..progress import progress_bar
from ..quantity import DEGREES, Quantity
from ..records import StrapdownRecord
from ..result import Result
from .attitude import AttitudeRun, attitude_error, run_attitude

REFERENCE = "adaptive-degree"
"""The algorithm that the others are compared with, at the record's own rate."""

ARITHMETICS = ("single", "carried", "compensated", "pairs")
"""How the attitude is carried.

single: λ ∘ λ*, everything in 32 bits. carried: λ + λ ∘ (-(1 - λ0*), λv*), everything in 32 bits. compensated: the same,
with the low part of λ kept. pairs: the same, with λv* a pair and the products error-free.
"""
ZERO, QUARTER, SIXTH, ONE, TWO = (np.float32(value) for value in (0.0, 0.25, 1.0 / 6.0, 1.0, 2.0))
CUBIC = np.float32(1.0 / 48.0)
SPLITTER = np.float32(4097.0)
"""2^12 + 1: splits the 24 bits of a mantissa into halves."""
LANES = 8
"""Runs that advance together: one instruction then acts on four or eight of them."""
OF_LANE = 51
"""Numbers of one of them: errors, generator, remainder, attitude, and the increments of the step before."""
STARTED = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""No remainder, and the attitude at the start."""
STREAM = 4.0
"""Stream of the numbers that `GyroBlock` draws its bounded errors from."""
ROUNDINGS = ("independently", "feedback", "pairs")
"""How increments become 32-bit numbers: each rounded by itself; the rounding error of one added to the next; as the sum
of two 32-bit numbers."""


class ComparedAlgorithm(Result):
    """One row of a comparison; None where undetermined.

    Attributes
    ----------
    algorithm : str
    order : int
    updates : int
        number of updates of the run
    apart : float or None
        largest angle to the reference's attitude at common moments [rad]
    rms, maximum : float or None
        of the error against the true attitude [rad]
    refused : str
        why the algorithm does not take this record; empty where it does
    samples : int
        in one step
    rows_left_out : int or None
        last rows, which fill no step; None where the algorithm does not take the record
    """

    algorithm: Annotated[str, Quantity("algorithm")]
    order: Annotated[int, Quantity("order")]
    updates: Annotated[int, Quantity("updates")] = 0
    apart: Annotated[float | None, Quantity("from the reference", "deg", "nearest", 3, DEGREES)] = Field(
        default=None, alias="from_reference_rad"
    )
    rms: Annotated[float | None, Quantity("error rms", "deg", "nearest", 3, DEGREES)] = Field(
        default=None, alias="error_rms_rad"
    )
    maximum: Annotated[float | None, Quantity("error max", "deg", "up", 3, DEGREES)] = Field(
        default=None, alias="error_max_rad"
    )
    refused: Annotated[str, Quantity("not taken")] = Field(default="", alias="not_taken")
    samples: int = Field(default=0, exclude=True)
    rows_left_out: Annotated[int | None, Quantity("rows left out")] = Field(default=None, exclude=True)


class AttitudeComparison(Result):
    """Comparison of several attitude algorithms on a strapdown record, with the record's warnings as of a run."""

    schema_: Literal["trihedron.attitude-comparison/1"] = Field(
        default="trihedron.attitude-comparison/1", alias="schema"
    )
    reference: str = REFERENCE
    bridged_bound: float = Field(default=0.0, alias="bridged_bound_rad")
    trusted_until: float | None = Field(default=None, alias="trusted_until_s")
    warnings: tuple[str, ...] = ()
    algorithms: tuple[ComparedAlgorithm, ...]

    def to_polars(self) -> pl.DataFrame:
        """Return a row for each algorithm, angles in degrees; null where undetermined, or where all can be trusted."""
        table = pl.DataFrame(
            [row.model_dump() | {"samples": row.samples} for row in self.algorithms], infer_schema_length=None
        )
        angles = {"from_reference": "from_reference_rad", "error_rms": "error_rms_rad", "error_max": "error_max_rad"}
        return table.select(
            "algorithm",
            "order",
            "samples",
            "updates",
            *(pl.col(old).cast(pl.Float64).degrees().alias(f"{new}_deg") for new, old in angles.items()),
            "not_taken",
            pl.lit(self.trusted_until, dtype=pl.Float64).alias("trusted_until_s"),
        )


def compare_algorithms(
    record: StrapdownRecord,
    *,
    rates: str = "instantaneous",
    rate_divisor: int = 1,
    bridge_gaps: int = 0,
    algorithms: Sequence[Algorithm] = ALGORITHMS,
    progress: bool = False,
) -> AttitudeComparison:
    """Run algorithms over a record through the attitude computer's FMU; options as of `run_attitude`.

    The reference runs at the record's own rate. An InputError for a record that no algorithm can take.
    """
    rows = []
    with progress_bar("attitude", 1 + len(algorithms), show=progress) as advance:
        options: dict[str, Any] = {"rates": rates, "bridge_gaps": bridge_gaps}
        reference = run_attitude(record, algorithm=REFERENCE, **options)
        advance(1)
        for algorithm in algorithms:
            entries: dict[str, Any] = {"algorithm": algorithm.name, "order": algorithm.order}
            entries["samples"] = algorithm.samples
            try:
                run = run_attitude(record, algorithm=algorithm.name, rate_divisor=rate_divisor, **options)
            except InputError as error:
                rows.append(ComparedAlgorithm(**entries, not_taken=str(error)))
            else:
                entries |= {"updates": run.updates, "rows_left_out": run.rows_left_out}
                entries["from_reference_rad"] = _apart(run, reference)
                entries |= {"error_rms_rad": run.rms, "error_max_rad": run.maximum}
                rows.append(ComparedAlgorithm(**entries))
            advance(1)
    if all(row.refused for row in rows):
        raise InputError(rows[0].refused)
    return AttitudeComparison(
        bridged_bound_rad=reference.bridged_bound,
        trusted_until_s=reference.trusted_until,
        warnings=reference.warnings,
        algorithms=tuple(rows),
    )


def _apart(run: AttitudeRun, reference: AttitudeRun) -> float | None:
    """Largest angle between two runs after the start, at moments when both were updated [rad]."""
    # The reference is carried at the record's own rate; bridged rows share the number of another.
    steps = [
        np.round((attitudes.time_s[1:] - reference.time_s[0]) / reference.period) for attitudes in (run, reference)
    ]
    _, updates, references = np.intersect1d(*steps, assume_unique=True, return_indices=True)
    if not updates.size:
        return None
    difference = attitude_error(run.attitude[1:][updates], reference.attitude[1:][references])
    return float(np.linalg.norm(difference, axis=1).max())


@dataclass(frozen=True)
class Samples:
    """Increments (N, 3) of the gyros over each sample period [s] of a motion; true ψ, ϑ, γ (N, 3) at its end [rad]."""

    period: float
    increments: NDArray
    angles: NDArray

    def angles_at_steps(self, algorithm: Algorithm) -> NDArray:
        """True angles at the end of each step of an algorithm."""
        samples = algorithm.samples
        return self.angles[samples - 1 : len(self.angles) // samples * samples : samples]


def sample_motion(harmonics: NDArray, period: float, count: int, intervals: int = 0) -> Samples:
    """Increments and true angles of a harmonic motion.

    Parameters
    ----------
    harmonics : ndarray, shape (36,)
        of the motion
    period : float
        of the gyro samples [s]
    count : int
        number of samples
    intervals : int
        of the trapezoid rule in each sample; 0: increments exact to rounding
    """
    increments, angles = np.empty((count, 3)), np.empty((count, 3))
    axes = harmonics.reshape(3, harmonic_motion.HARMONICS, 3)
    shaking = axes[:, :, 0] != 0.0
    bandwidth = float((np.abs(axes[:, :, 1]) * (1.0 + np.abs(axes[:, :, 0])))[shaking].sum())
    pieces = 1 + math.floor(bandwidth * period / harmonic_motion.PHASE_OF_PIECE)
    _sampler(loops_over(count))(harmonics, period, intervals, pieces, increments, angles)
    return Samples(period, increments, angles)


def run_algorithm(algorithm: Algorithm, increments: NDArray, renormalise: bool = False) -> NDArray:
    """Attitudes (N // samples, 4), scalar first, at the end of each step of an algorithm, from the attitude 1.

    The increments (N, 3) are of the gyro samples [rad]; samples that do not fill a step are left out.
    """
    attitudes = np.empty((len(increments) // algorithm.samples, 4))
    work = (_table_of(algorithm.number), np.zeros(SPACE_SIZE), np.zeros(4))
    run = _runner(algorithm.kernel, algorithm.previous, loops_over(len(increments)))
    run(np.ascontiguousarray(increments), algorithm.samples, renormalise, work, attitudes)
    return attitudes


@cache
def _table_of(algorithm: int) -> NDArray:
    """Return the table of an algorithm; plain Python writes it once, in the time of 5,000 samples."""
    table = [0.0] * TABLE_SIZE
    prepare_update(float(algorithm), list(PRODUCTS), table)
    return np.array(table)


@cache
def _sampler(makers: Makers) -> Callable[..., None]:
    kernel_made, loop_made = makers
    trapezoid, exactly, move = (
        kernel_made(kernel)
        for kernel in (
            harmonic_motion.integrate_by_trapezoid,
            harmonic_motion.integrate_exactly,
            harmonic_motion.move_harmonically,
        )
    )

    @loop_made
    def sample(harmonics, period, intervals, pieces, increments, angles):
        angle, angle_rate, rate, increment = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
        for k in range(len(increments)):
            if intervals > 0:
                trapezoid(k * period, period, intervals, harmonics, angle, angle_rate, rate, increment)
            else:
                exactly(k * period, period, pieces, harmonics, angle, angle_rate, rate, increment)
            increments[k] = increment
            move((k + 1) * period, harmonics, angle, angle_rate, rate)
            angles[k] = angle

    return sample


@cache
def _runner(kernel: Callable[..., Any], keeps_previous: bool, makers: Makers) -> Callable[..., None]:
    kernel_made, loop_made = makers
    turn = _turn(kernel, keeps_previous, kernel_made)
    multiply, normalise = kernel_made(rotation.multiply), kernel_made(rotation.normalise)

    @loop_made
    def run(increments, samples, renormalise, work, attitudes):
        attitude, turned = np.zeros(4), np.zeros(4)
        attitude[0] = 1.0
        previous, g = np.zeros(STEP_SIZE), np.zeros(STEP_SIZE)
        preceded = 0.0
        for k in range(len(attitudes)):
            for i in range(samples):
                for j in range(3):
                    g[3 * i + j] = increments[samples * k + i, j]
            turn(samples, preceded, (previous, g), work, turned)
            preceded = 1.0
            multiply(attitude, turned, attitude)
            if renormalise:
                normalise(attitude)
            for i in range(4):
                attitudes[k, i] = attitude[i]
            if keeps_previous:
                for i in range(3 * samples):
                    previous[i] = g[i]

    return run


def _turn(step: Callable[..., Any], previous: bool, kernel_made: Callable[..., Any]) -> Callable[..., None]:
    """Kernel with one signature for all: samples, whether a step precedes, increments of both, work, result."""
    kernel = kernel_made(step)
    if step in (by_products, by_products_and_series, by_products_cut_off):

        def turn(samples, preceded, steps, work, turned):
            kernel(steps[0], steps[1], work[0], work[2], turned)

    elif step in (functional_iteration, rodrigues_iteration):

        def turn(samples, preceded, steps, work, turned):
            kernel(samples, steps[1], 0, work[0], work[1], turned)

    elif step is adaptive_degree:

        def turn(samples, preceded, steps, work, turned):
            kernel(steps[0], preceded, steps[1], work[0], work[1], work[2], turned)

    elif previous:

        def turn(samples, preceded, steps, work, turned):
            kernel(steps[0], steps[1], turned)

    else:

        def turn(samples, preceded, steps, work, turned):
            kernel(steps[1], turned)

    if kernel_made is compiled:
        return compile_callee(turn, allocates=False)
    return turn


class GyroErrors(NamedTuple):
    """Errors of the gyros of a run: Γ (9,) row by row, bias (3,) and bound of the errors [rad/s], quantum [rad]."""

    scale_misalignment: NDArray
    bias: NDArray
    quantum: float
    noise_bound: float
    seed: int


def read_increments(
    samples: Samples,
    scale_misalignment: NDArray,
    bias: NDArray,
    quantum: float,
    noise_bound: float,
    seed: int,
) -> NDArray:
    """Return exact increments as gyros with errors read them, by the kernels of `trihedron.models.gyro`: (N, 3) [rad].

    The errors are those of `GyroErrors`; a quantum of 0: exact.
    """
    gyros = instantiate(GYRO_BLOCK)
    memory = {}
    for name, values in gyros.memory.items():
        memory[name] = np.array(values, dtype=float)
    memory |= {"scale_misalignment": np.array(scale_misalignment), "bias": np.array(bias)}
    parameters: dict[str, float] = {"input_kind": 1.0, "quantum": quantum, "noise_bound": noise_bound, "seed": seed}

    def arguments(kernel: str) -> tuple[Any, ...]:
        names = []
        for name in gyros.arguments[kernel]:
            if name not in ("time", "step"):
                names.append(name)
        scalars = {name: float(memory[name][0]) for name in names if name in gyros.scalars}
        scalars |= {name: float(value) for name, value in parameters.items() if name in scalars}
        numbers = []
        for name in names:
            numbers.append(scalars.get(name, memory[name]))
        return tuple(numbers)

    readings, ports = samples.increments.copy(), (memory["increment"], memory["increment_reading"])
    if status := _reader(loops_over(len(readings)))(
        samples.period, readings, arguments("initialise"), arguments("step"), ports
    ):
        raise InputError(GYRO_BLOCK.messages[status - 1])
    return readings


@cache
def _reader(makers: Makers) -> Callable[..., int]:
    kernel_made, loop_made = makers
    initialise, step = cast("tuple[Any, Any]", (kernel_made(gyro.initialise_gyros), kernel_made(gyro.step_gyros)))

    @loop_made
    def read(period, rows, to_initialise, to_step, ports):
        increment, reading = ports
        status = initialise(0.0, *to_initialise)
        for k in range(len(rows)):
            if status != 0:
                return status
            for p in range(3):
                increment[p] = rows[k, p]
            status = step(k * period, period, *to_step)
            for p in range(3):
                rows[k, p] = reading[p]
        return status

    return read


def angles_of_runs(
    algorithm: Algorithm, samples: Samples, true: NDArray, runs: Sequence[GyroErrors]
) -> Iterator[NDArray]:
    """Yield for each run its angles (steps,) to the true attitudes (N, 4) at the ends of steps [rad].

    They have the bits of `read_increments`, `run_algorithm` with renormalisation and `angle_between`. `LANES` runs
    advance together, and the next ones overwrite their angles.
    """
    ends = np.ascontiguousarray(true[algorithm.samples - 1 :: algorithm.samples])
    apart = np.empty((LANES, len(samples.increments) // algorithm.samples))
    work = (_table_of(algorithm.number), np.zeros(SPACE_SIZE), np.zeros(4))
    in_quanta = any(run.quantum > 0.0 for run in runs)
    run_lanes = _lanes(algorithm.kernel, algorithm.previous, algorithm.samples, in_quanta)
    rates = samples.increments / samples.period
    for first in range(0, len(runs), LANES):
        begun = []
        for run in runs[first : first + LANES]:
            generator = [0.0] * GENERATOR_SIZE
            seed_generator(float(run.seed), STREAM, generator)
            # The reading at the start has errors, too.
            gyro.draw_error(1.0, generator, [0.0] * 3)
            errors = [*run.scale_misalignment, *run.bias, run.quantum, run.noise_bound]
            begun.append([*errors, *generator, *STARTED, *[0.0] * (OF_LANE - 27)])
        filled = begun + begun[-1:] * (LANES - len(begun))
        run_lanes(samples.period, rates, np.ascontiguousarray(np.transpose(filled)), work, ends, apart)
        yield from apart[: len(begun)]


@cache
def _lanes(kernel: Callable[..., Any], keeps_previous: bool, samples: int, in_quanta: bool) -> Callable[..., None]:
    turn, compare = _turn(kernel, keeps_previous, compiled), compiled(rotation.compare)
    multiply, normalise = compiled(rotation.multiply), compiled(rotation.normalise)
    draw_error, read_rates = compiled(gyro.draw_error), compiled(gyro.read_rates)
    read_in_quanta, (view, place) = compiled(gyro.read_in_quanta), local_array()
    small_angle, angle_of_half = compiled(rotation.small_angle), compiled(rotation.angle_of_half)
    changed = OF_LANE if keeps_previous else 27

    @loop_compiled
    def run(period, rates, begun, work, ends, apart):
        # The errors of a run, then its generator, carried remainder, attitude and last step; `kept`: of all runs.
        of, kept, result = view(place(51), 51), view(place(408), (51, LANES)), view(place(16), (2, LANES))
        gamma, bias, generator, carried, attitude, previous = of[:9], of[9:12], of[14:20], of[20:23], of[23:27], of[27:]
        nothing, error, rate, increment = view(place(3), 3), view(place(3), 3), view(place(3), 3), view(place(3), 3)
        reading, added, own, half = view(place(3), 3), view(place(3), 3), view(place(3), 3), view(place(2), 2)
        g, turned, angle = view(place(24), 24), view(place(4), 4), view(place(8), LANES)
        for i in range(51):
            for lane in range(LANES):
                kept[i, lane] = begun[i, lane]
        for k in range(apart.shape[1]):
            for lane in range(LANES):
                for i in range(51):
                    of[i] = kept[i, lane]
                for i in range(samples):
                    for p in range(3):
                        rate[p] = rates[samples * k + i, p]
                    draw_error(of[13], generator, error)
                    read_rates(gamma, bias, nothing, error, rate, nothing, reading, added, own)
                    # A constant zero leaves no division and no rounding in the machine code.
                    read_in_quanta(period, of[12] if in_quanta else 0.0, reading, carried, increment)
                    for p in range(3):
                        g[3 * i + p] = increment[p]
                turn(samples, min(1.0, float(k)), (previous, g), work, turned)
                for i in range(3 * samples):
                    previous[i] = g[i]
                multiply(attitude, turned, attitude)
                normalise(attitude)
                for i in range(14, changed):
                    kept[i, lane] = of[i]
                compare(attitude, ends[k], half)
                for i in range(2):
                    result[i, lane] = half[i]
                angle[lane] = small_angle(half[0], half[1])
            for lane in range(LANES):
                if not result[0, lane] < rotation.SMALL_RATIO * result[1, lane]:
                    angle[lane] = angle_of_half(result[0, lane], result[1, lane])
                apart[lane, k] = angle[lane]

    return run


def rounded_increments(increments: NDArray, rounding: str) -> tuple[NDArray, NDArray]:
    """Increments (N, 3) [rad] as 32-bit numbers, high and low, by one of `ROUNDINGS`; low is zero but for pairs."""
    high = increments.astype(np.float32)
    low = np.zeros_like(high)
    if rounding == "pairs":
        low = (increments - high).astype(np.float32)
    elif rounding == "feedback":
        _feedback()(np.ascontiguousarray(increments, dtype=np.float64), high)
    return high, low


def run_single(high: NDArray, low: NDArray, arithmetic: str) -> NDArray:
    """Attitudes (N // 2, 4) at every second sample from increments high + low (N, 3) [rad], by one of `ARITHMETICS`.

    Quaternions, scalar first, as the 32-bit numbers have them: nothing renormalises them.
    """
    attitudes = np.empty((len(high) // 2, 4))
    _short_words()(high.astype(np.float32), low.astype(np.float32), ARITHMETICS.index(arithmetic), attitudes)
    return attitudes


@cache
def _feedback() -> Callable[..., Any]:
    """Return the function that writes 32-bit increments (N, 3): each rounding error is added to the next."""

    @loop_compiled
    def round_all(increments, rounded):
        for i in range(increments.shape[1]):
            carried = 0.0
            for k in range(len(increments)):
                carried = carried + increments[k, i]
                rounded[k, i] = np.float32(carried)
                carried = carried - np.float64(rounded[k, i])

    return round_all


@cache
def _short_words() -> Callable[..., Any]:
    multiply = compiled(rotation.multiply)

    @loop_compiled
    def two_sum(a, b):
        total = a + b
        part = total - a
        return total, (a - (total - part)) + (b - part)

    @loop_compiled
    def split(a):
        big = SPLITTER * a
        high = big - (big - a)
        return high, a - high

    @loop_compiled
    def two_product(a, b):
        product = a * b
        a1, a2 = split(a)
        b1, b2 = split(b)
        return product, ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2

    @loop_compiled
    def rodrigues(high, low, k, x, x_low):
        """x of (22) as a pair: the sum of the increments is exact, the small terms are single."""
        a, b = high[k], high[k + 1]
        first = CUBIC * (a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
        second = CUBIC * (b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            total, rest = two_sum(a[i], b[i])
            rest = rest + (low[k, i] + low[k + 1, i])
            small = first * a[i] + second * b[i] + SIXTH * (a[j] * b[m] - a[m] * b[j])
            x[i], x_low[i] = two_sum(QUARTER * total, QUARTER * rest + small)

    @loop_compiled
    def add_product(sign, q, v, total):
        """Add ± q v, each a pair, to a pair, without an error in the leading product."""
        leading, error = two_product(q[0], v[0])
        high, rest = two_sum(total[0], sign * leading)
        return high, total[1] + (rest + sign * (error + (q[0] * v[1] + q[1] * v[0])))

    @loop_compiled
    def pair_product(q, q_low, v, v_low, d, d_low):
        """d = q ∘ v in pairs; component 0 of v is a single number."""
        right = ((0, 1, 2, 3), (1, 0, 3, 2), (2, 3, 0, 1), (3, 2, 1, 0))
        signs = ((ONE, -ONE, -ONE, -ONE), (ONE, ONE, ONE, -ONE), (ONE, -ONE, ONE, ONE), (ONE, ONE, -ONE, ONE))
        for i in range(4):
            total = (ZERO, ZERO)
            for j in range(4):
                k = right[i][j]
                total = add_product(signs[i][j], (q[j], q_low[j]), (v[k], v_low[k]), total)
            d[i], d_low[i] = total

    @loop_compiled
    def run(high, low, arithmetic, attitudes):
        q, q_low = np.zeros(4, np.float32), np.zeros(4, np.float32)
        v, v_low = np.zeros(4, np.float32), np.zeros(4, np.float32)
        d, d_low = np.zeros(4, np.float32), np.zeros(4, np.float32)
        x, x_low = np.zeros(3, np.float32), np.zeros(3, np.float32)
        q[0] = ONE
        for k in range(len(attitudes)):
            rodrigues(high, low, 2 * k, x, x_low)
            square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
            part = square / (ONE + square)
            # -(1 - λ0*), and λv* = 2x - 2x (x·x)/(1 + x·x).
            v[0] = -TWO * part
            for i in range(3):
                v[i + 1], v_low[i + 1] = two_sum(TWO * x[i], TWO * x_low[i] - TWO * x[i] * part)
            if arithmetic == 0:
                v[0] = (ONE - square) / (ONE + square)
                multiply(q, v, q)
            elif arithmetic == 3:
                pair_product(q, q_low, v, v_low, d, d_low)
            else:
                multiply(q, v, d)
            if arithmetic == 1:
                for i in range(4):
                    q[i] = q[i] + d[i]
            if arithmetic > 1:
                for i in range(4):
                    total, rest = two_sum(q[i], d[i])
                    q[i], q_low[i] = two_sum(total, rest + (q_low[i] + d_low[i]))
            for i in range(4):
                attitudes[k, i] = np.float64(q[i]) + np.float64(q_low[i])

    return run
