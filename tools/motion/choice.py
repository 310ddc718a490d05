"""Which attitude algorithm to take: error against cost of them all, on one motion as one's own gyros read it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import polars as pl
from pydantic import Field

from ...fmus.motions import HARMONIC_MOTION
from ...fmus.source import instantiate
from ...models.attitude_algorithms import ALGORITHMS, Algorithm
from ...models.harmonic_motion import HARMONICS, store_harmonics
from ..errors import InputError
from ..progress import tracked
from ..records import StrapdownRecord
from ..result import Result
from .attitude import algorithm_named, angle_between, attitudes_of_angles, rotation_of
from .compare import REFERENCE, Samples, read_increments, run_algorithm, sample_motion
from .increments import coarser, taken_from
from .operations import operations_of_update

ADAPTIVE = "adaptive-degree"
ENOUGH = 1.2
"""So many times the least error is as good as it."""
DRAWS = 16
"""How often gyros with quanta or noise are drawn: by one draw alone a worse algorithm may look better by luck."""
WINDOWS = 3
"""Places of a motion where operations are counted."""
ANGLES = ("psi", "theta", "gamma")
FEWEST_SAMPLES, MOST_SAMPLES = 64, 1_000_000


@dataclass(frozen=True)
class Course:
    """A motion as exact gyros sample it.

    Attributes
    ----------
    period : float
        of the samples [s]
    increments : (N, 3) array
        [rad]
    at : (K,) array of int
        samples, from 1, at whose ends the true attitude is known
    attitudes : (K, 4) array
        that attitude against the one at the beginning, scalar first
    """

    period: float
    increments: np.ndarray
    at: np.ndarray
    attitudes: np.ndarray


def harmonics_of(given: Mapping[str, Any]) -> np.ndarray:
    """The harmonics (36,) of parameters of `HarmonicMotion`, all others as they start; an InputError for wrong ones."""
    known = {name: values for name, values in instantiate(HARMONIC_MOTION).memory.items() if name.startswith(ANGLES)}
    for name, values in given.items():
        if not name.startswith(ANGLES):
            continue
        numbers = np.ravel(values) if name in known else np.zeros(0)
        if not (1 <= len(numbers) <= HARMONICS and np.isfinite(numbers.astype(float)).all()):
            raise InputError(f"{name}: must be up to {HARMONICS} numbers of {', '.join(known)}")
        known[name] = [*map(float, numbers), *known[name][len(numbers) :]]
    harmonics, pi = [0.0] * (9 * HARMONICS), float(given.get("pi", math.pi))
    for axis, letter in enumerate(ANGLES):
        parts = (known[f"{letter}_{part}"] for part in ("amplitude", "frequency", "phase"))
        amplitude, frequency, phase = parts
        store_harmonics(axis, pi, amplitude, frequency, phase, harmonics)
    return np.array(harmonics)


def cone(half_angle: float, frequency: float) -> np.ndarray:
    """The harmonics of a cone, half angle [rad] and frequency [Hz]: ϑ = A sin Ωt, γ = A cos Ωt - A."""
    quarter = 0.5 * math.pi
    of_gamma = {"amplitude": (half_angle, -half_angle), "frequency": (frequency, 0.0), "phase": (quarter, quarter)}
    return harmonics_of(
        {"psi_amplitude": 0.0, "theta_amplitude": half_angle, "theta_frequency": frequency}
        | {f"gamma_{part}": values for part, values in of_gamma.items()}
    )


def course_of_harmonics(harmonics: np.ndarray, rate_hz: float, duration_s: float) -> Course:
    """A harmonic motion (36,), its increments and attitudes exact to rounding."""
    samples = sample_motion(harmonics, 1.0 / rate_hz, checked_count(rate_hz, duration_s))
    axes = harmonics.reshape(3, -1, 3)
    first = (axes[:, :, 0] * np.sin(axes[:, :, 2])).sum(axis=1)
    begin, true = (rotation_of(attitudes_of_angles(angles)) for angles in (first[None], samples.angles))
    attitudes = np.roll((begin[0].inv() * true).as_quat(), 1, axis=1)
    return Course(samples.period, samples.increments, np.arange(1, len(attitudes) + 1), attitudes)


def checked_count(rate_hz: float, duration_s: float) -> int:
    """How many samples that is; an InputError where it is too few or too many."""
    count = rate_hz * duration_s
    if not FEWEST_SAMPLES <= count <= MOST_SAMPLES:
        raise InputError(
            f"--rate-hz {rate_hz:g}, --duration {duration_s:g}: must be {FEWEST_SAMPLES} to {MOST_SAMPLES} samples"
        )
    return round(count)


def course_of_record(record: StrapdownRecord, divisor: int) -> Course:
    """A measured motion: what its gyros say at their own rate is taken for true, and every so many rows are a sample.

    The true attitude is that of `REFERENCE` at the record's rate. An InputError for a record too short or not uniform.
    """
    if not divisor >= 2:
        raise InputError(f"--rate-divisor {divisor}: must be 2 or more; what is between the samples tells the truth")
    own = taken_from(record, "instantaneous").increments
    slower = coarser(own, divisor)
    if len(slower.angle) < FEWEST_SAMPLES:
        needed = f"{FEWEST_SAMPLES * divisor} rows, {FEWEST_SAMPLES} samples of --rate-divisor {divisor}"
        raise InputError(f"{record.path.name}: must have {needed}")
    finest = algorithm_named(REFERENCE)
    true = run_algorithm(finest, own.angle, renormalise=True)
    rows = finest.samples * np.arange(1, len(true) + 1)
    known = rows % divisor == 0
    return Course(slower.period, slower.angle, rows[known] // divisor, true[known])


class Candidate(Result):
    """One algorithm: operations for each gyro sample, and its largest error [rad], None where it cannot be run."""

    algorithm: str
    order: int
    samples: int
    operations: float
    error: float | None = Field(alias="error_rad")


class Choice(Result):
    """Error against cost of all attitude algorithms on one motion; the error is the root mean square over the draws."""

    schema_: Literal["trihedron.choice/1"] = Field(default="trihedron.choice/1", alias="schema")
    title: str
    rate_hz: float
    duration_s: float
    quantum_rad: float
    noise_radps: float
    draws: int
    algorithms: tuple[Candidate, ...]

    @property
    def able(self) -> list[Candidate]:
        """Those that can be run, from the cheapest on."""
        found = [one for one in self.algorithms if one.error is not None]
        return sorted(found, key=lambda one: (one.operations, one.error))

    @property
    def frontier(self) -> list[Candidate]:
        """Those that no cheaper one betters, from the cheapest on."""
        best: list[Candidate] = []
        for one in self.able:
            if not best or error_of(one) < error_of(best[-1]):
                best.append(one)
        return best

    @property
    def best(self) -> Candidate:
        """The one with the least error."""
        return self.frontier[-1]

    @property
    def enough(self) -> Candidate:
        """The cheapest whose error is at most `ENOUGH` times the least."""
        return next(one for one in self.frontier if error_of(one) <= ENOUGH * error_of(self.best))

    @property
    def adaptive(self) -> tuple[Candidate, float]:
        """The adaptive algorithm, and its error over the least of those that are no costlier."""
        own = next(one for one in self.algorithms if one.algorithm == ADAPTIVE)
        return own, error_of(own) / min(error_of(one) for one in self.able if one.operations <= own.operations)

    def to_polars(self) -> pl.DataFrame:
        """A row for each algorithm: algorithm, order, samples, operations, error_deg, on_frontier."""
        best = {one.algorithm for one in self.frontier}
        rows = [
            {
                **one.model_dump(exclude={"error"}),
                "error_deg": None if one.error is None else math.degrees(one.error),
                "on_frontier": one.algorithm in best,
            }
            for one in self.algorithms
        ]
        return pl.DataFrame(rows, infer_schema_length=None)


def error_of(one: Candidate) -> float:
    """The error [rad]; of what cannot be run it is infinite."""
    return math.inf if one.error is None else one.error


def reading_told(quantum_arcsec: float, noise_radps: float) -> str:
    """What gyros with a quantum and noise within a bound are called; an InputError for those that there are not."""
    told = []
    for option, value, most, words in (
        ("quantum-arcsec", quantum_arcsec, 3600.0, "quanta of {:g}″"),
        ("noise-radps", noise_radps, 1.0, "noise of {:g} rad/s"),
    ):
        if not 0.0 <= value <= most:
            raise InputError(f"--{option} {value:g}: must be from 0 to {most:g}")
        told += [words.format(value)] if value else []
    return " and ".join(told) or "exact"


def choose_algorithm(
    course: Course,
    title: str,
    *,
    quantum: float = 0.0,
    noise_bound: float = 0.0,
    progress: bool = False,
) -> Choice:
    """Every algorithm on a motion; gyros with a quantum [rad] or noise within a bound [rad/s] are drawn `DRAWS` times.

    An InputError where no algorithm can be run.
    """
    draws = DRAWS if quantum + noise_bound > 0.0 else 1
    drawn = [_read(course, quantum, noise_bound, seed) for seed in range(1, 1 + draws)]
    longest = np.linalg.norm(drawn[0], axis=1).max()
    rows = []
    for algorithm in tracked(ALGORITHMS, "attitude algorithms", show=progress):
        able = longest <= algorithm.max_increment
        rows.append(
            Candidate(
                algorithm=algorithm.name,
                order=algorithm.order,
                samples=algorithm.samples,
                operations=operations_on(algorithm, drawn[0]),
                error_rad=_rms_error(algorithm, drawn, course) if able else None,
            )
        )
    if all(row.error is None for row in rows):
        raise InputError(f"{title}: an increment of {longest:.3g} rad is too long for every algorithm; sample faster")
    return Choice(
        title=title,
        rate_hz=1.0 / course.period,
        duration_s=course.period * len(course.increments),
        quantum_rad=quantum,
        noise_radps=noise_bound,
        draws=draws,
        algorithms=tuple(rows),
    )


def _read(course: Course, quantum: float, noise: float, seed: int) -> np.ndarray:
    """What gyros make of increments; the first quantum is in part passed when the motion begins."""
    exact = course.increments.copy()
    exact[0] += quantum * np.random.default_rng(seed).uniform(-0.5, 0.5, 3)
    begun = Samples(course.period, exact, np.zeros((0, 3)))
    return read_increments(begun, np.zeros(9), np.zeros(3), quantum, noise, seed) if quantum + noise else exact


def _rms_error(algorithm: Algorithm, drawn: Sequence[np.ndarray], course: Course) -> float | None:
    squares = []
    for increments in drawn:
        attitudes = run_algorithm(algorithm, increments, renormalise=True, runs=len(drawn))
        ends = algorithm.samples * np.arange(1, len(attitudes) + 1)
        _, own, true = np.intersect1d(ends, course.at, assume_unique=True, return_indices=True)
        if not len(own):
            return None
        squares.append(float(angle_between(attitudes[own], course.attitudes[true]).max()) ** 2)
    return math.sqrt(sum(squares) / len(squares))


def operations_on(algorithm: Algorithm, increments: np.ndarray) -> float:
    """Operations for each gyro sample: the mean over places of the motion, what some algorithms do depends on it."""
    size = 2 * algorithm.samples
    begins = np.linspace(0, len(increments) - size, WINDOWS + 1).astype(int)[1:]
    return sum(operations_of_update(algorithm, increments[b : b + size]) for b in begins) / WINDOWS / algorithm.samples
