"""A run of an attitude algorithm over a motion that is known, with gyros that err."""

from collections.abc import Callable, Mapping
from functools import cache, lru_cache
from typing import Any, cast

import numba
import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...fmus.gyros import GYRO_BLOCK
from ...fmus.source import instantiate
from ...models.attitude_algorithms import ALGORITHMS, Algorithm
from ...models.blocks import gyro
from ..compiled import compiled
from ..errors import InputError, nearest
from ..motion.attitude import algorithm_named
from ..motion.attitude_error import angle_between, attitudes_of_angles
from ..motion.compare import Samples, run_algorithm, sample_motion
from ..papers.attitude import EXACT, paper_motion
from .design import Value, short_seed
from .file import Campaign
from .kinds import Output, Result
from .settings import AttitudeSetting

ERRORS = (
    *(f"bias_{p}_radps" for p in (1, 2, 3)),
    *(f"scale_misalignment_{p}{q}" for p in (1, 2, 3) for q in (1, 2, 3)),
    *("quantum_rad", "noise_bound_radps"),
)
"""Errors of the gyros that can be swept."""
MOTIONS = ("amplitude_factor", "frequency_factor", "motion", "rate_hz", "duration_s", "algorithm")
"""What can be swept beside them."""
INCREMENTS = 1.0
"""Kind of input of the gyros."""
MOST_SAMPLES = 100_000_000


class AttitudeRuns:
    """Attitude runs.

    Exact increments of a motion go through the kernels of `GyroBlock`, with the errors of the run, and through an
    algorithm. The scalars are the largest, the last and the rms angle between computed and true attitude, and the last
    over the length of the run.
    """

    def __init__(self, campaign: Campaign, setting: AttitudeSetting) -> None:
        self.setting = setting
        self.record = campaign.keep.record
        known = [*ERRORS, *MOTIONS]
        for name, axis in campaign.parameters.items():
            if name not in known:
                raise InputError(f"parameters.{name}: is not known; {nearest(name, known)}")
            for value in axis.listed() if axis.discrete else ():
                if name == "algorithm":
                    _algorithm(str(value), f"parameters.{name}")
        if campaign.keep.diagnosis:
            raise InputError("keep.diagnosis: an attitude run has no diagnosis")
        _algorithm(setting.algorithm, "attitude.algorithm")
        paper_motion(setting.motion, EXACT)
        self.outputs = {
            name: Output(pl.Float64, "lower")
            for name in ("largest_error_rad", "last_error_rad", "rms_error_rad", "drift_radps")
        }

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> Result:
        """Make a run."""
        setting = self.setting

        def of(name: str, usual: float) -> float:
            return float(values.get(name, usual))

        rate, duration = of("rate_hz", setting.rate_hz), of("duration_s", setting.duration_s)
        if not 8 <= rate * duration <= MOST_SAMPLES:
            raise InputError(
                f"rate_hz {rate:g} times duration_s {duration:g}: a run has from 8 to {MOST_SAMPLES} samples"
            )
        algorithm = _algorithm(str(values.get("algorithm", setting.algorithm)), "algorithm")
        samples, attitudes = motion_samples(
            str(values.get("motion", setting.motion)),
            of("amplitude_factor", 1.0),
            of("frequency_factor", 1.0),
            1.0 / rate,
            round(rate * duration),
        )
        read = read_increments(
            samples,
            np.array([of(f"scale_misalignment_{p}{q}", 0.0) for p in (1, 2, 3) for q in (1, 2, 3)]),
            np.array([of(f"bias_{p}_radps", 0.0) for p in (1, 2, 3)]),
            of("quantum_rad", 0.0),
            of("noise_bound_radps", setting.noise_bound_radps),
            short_seed(seed),
        )
        computed = run_algorithm(algorithm, read, renormalise=True)
        every = algorithm.samples
        angle = angle_between(computed, attitudes[every - 1 : len(attitudes) // every * every : every])
        last = float(angle[-1])
        scalars = {
            "largest_error_rad": float(angle.max()),
            "last_error_rad": last,
            "rms_error_rad": float(np.sqrt(np.mean(angle * angle))),
            "drift_radps": last / duration,
        }
        record = None
        if self.record:
            time = np.arange(1, len(angle) + 1) * (every / rate)
            columns = {f"q{k}": computed[:, k] for k in range(4)}
            record = pl.DataFrame({"time_s": time, **columns, "error_rad": angle})
        return Result(scalars, record)


def _algorithm(name: str, where: str) -> Algorithm:
    known = [algorithm.name for algorithm in ALGORITHMS]
    if name not in known:
        raise InputError(f"{where}: there is no attitude algorithm '{name}'; {nearest(name, known)}")
    return algorithm_named(name)


@lru_cache(maxsize=2)
def motion_samples(name: str, amplitude: float, frequency: float, period: float, count: int) -> tuple[Samples, NDArray]:
    """Exact increments of a motion and its true attitudes (N, 4), kept while the motion stays the same."""
    harmonics = paper_motion(name, EXACT).reshape(-1, 3).copy()
    harmonics[:, 0] *= amplitude
    harmonics[:, 1] *= frequency
    samples = sample_motion(harmonics.ravel(), period, count)
    return samples, attitudes_of_angles(samples.angles)


def read_increments(
    samples: Samples,
    scale_misalignment: NDArray,
    bias: NDArray,
    quantum: float,
    noise_bound: float,
    seed: int,
) -> NDArray:
    """What gyros with errors make of exact increments, by the kernels of `trihedron.models.blocks.gyro`.

    Parameters
    ----------
    samples : Samples
    scale_misalignment : (9,) array
        Γ, row by row
    bias : (3,) array
        [rad/s]
    quantum : float
        [rad]; 0: exact
    noise_bound : float
        [rad/s]
    seed : int
        of the errors

    Returns
    -------
    (N, 3) array
        [rad]
    """
    gyros = instantiate(GYRO_BLOCK)
    memory = {name: np.array(values, dtype=float) for name, values in gyros.memory.items()}
    memory |= {"scale_misalignment": np.array(scale_misalignment), "bias": np.array(bias)}
    given: dict[str, float] = {"input_kind": INCREMENTS, "quantum": quantum, "noise_bound": noise_bound, "seed": seed}

    def arguments(kernel: str, own: tuple[str, ...]) -> tuple[Any, ...]:
        names = [name for name in gyros.arguments[kernel] if name not in own]
        scalars = {
            name: float(given[name] if name in given else memory[name][0]) for name in names if name in gyros.scalars
        }
        return tuple(scalars.get(name, memory[name]) for name in names)

    read = np.empty_like(samples.increments)
    status = _reader()(
        samples.period,
        samples.increments,
        arguments("initialise", ("time",)),
        arguments("step", ("time", "step")),
        memory["increment"],
        memory["increment_reading"],
        read,
    )
    if status:
        raise InputError(GYRO_BLOCK.messages[status - 1])
    return read


@cache
def _reader() -> Callable[..., int]:
    initialise, step = cast("tuple[Any, Any]", (compiled(gyro.initialise), compiled(gyro.step)))

    @numba.njit(nogil=True, error_model="numpy")
    def read(period, increments, to_initialise, to_step, increment, reading, found):
        status = initialise(0.0, *to_initialise)
        for k in range(len(increments)):
            if status != 0:
                return status
            for p in range(3):
                increment[p] = increments[k, p]
            status = step(k * period, period, *to_step)
            for p in range(3):
                found[k, p] = reading[p]
        return status

    return read
