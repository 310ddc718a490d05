"""A measured strapdown record through the attitude computer's FMU, driven by the orchestrator."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import polars as pl

from ...models.attitude import ALGORITHMS, Algorithm
from ..errors import InputError, nearest
from ..orchestrator import simulate
from ..orchestrator.scenario import FmuSetting, RecordSetting, RunSetting, Scenario, Stimulus
from ..records import StrapdownRecord
from ..records.columns import INCREMENT, QUATERNION
from .run import AttitudeRun, attitude_error, heading_and_tilt, rotation_of
from .sampling import Increments, coarser, increments_from

VERTICAL_WITHIN = math.radians(5.0)
"""How near the mean specific force must be to the reference's third axis for that to count as the vertical [rad]."""


def attitude_of_record(
    record: StrapdownRecord,
    *,
    algorithm: str = "two-sample-rodrigues",
    rates: str = "instantaneous",
    gyro_bias: Sequence[float] | np.ndarray | None = None,
    rate_divisor: int = 1,
    out: Path | None = None,
    progress: bool = False,
) -> AttitudeRun:
    """Run the attitude computer's FMU on a record's gyros and compare it with the record's true attitude.

    The run begins at the first row whose true attitude is known, with that attitude (without any: at the first row,
    with the identity). Errors are taken only at updates, where the truth is known.

    Parameters
    ----------
    record : StrapdownRecord
        uniformly sampled
    algorithm : str
        name in `trihedron.models.attitude.ALGORITHMS`
    rates : str
        "instantaneous" (integrated by the trapezoid rule) or "averaged" (mean over the interval before each row)
    gyro_bias : sequence of 3 float or None
        rate that is taken out of every sample [rad/s], `rate_at_rest(record)` say; None: the rates as measured
    rate_divisor : int
        how many of the record's increments are added up to one, as a slower gyro would give them
    out : Path or None
        folder for the orchestrator's run; None: nothing is written
    progress : bool
        show a bar on standard error, where that is a terminal

    Returns
    -------
    AttitudeRun

    Raises
    ------
    InputError
        unknown algorithm or meaning of the rates; a record that is not uniform, has a gap, ends where its true
        attitude begins, or turns by more than the algorithm takes in one sample
    """
    chosen = _algorithm_named(algorithm)
    first, start = starting_attitude(record)
    increments = coarser(increments_from(record, first, rates, gyro_bias), rate_divisor)
    _check_range(record, chosen, increments, first, rate_divisor)
    run = simulate(_scenario(record, increments, chosen.number, start), out, progress=progress)
    updated = run.table["updated"].to_numpy()
    attitude = run.table.select(QUATERNION).to_numpy()[updated]
    index = first + rate_divisor * np.flatnonzero(updated)
    error = np.full((len(index), 3), np.nan)
    if record.attitude is not None:
        true = record.attitude[index]
        judged = np.isfinite(true).all(axis=1)
        error[judged] = attitude_error(attitude[judged], true[judged])
    heading = tilt = None
    if _third_axis_is_vertical(record):
        heading, tilt = np.full(len(index), np.nan), np.full(len(index), np.nan)
        judged = np.isfinite(error).all(axis=1)
        heading[judged], tilt[judged] = heading_and_tilt(error[judged])
    return AttitudeRun(
        record=record.path,
        algorithm=algorithm,
        rates="increments" if record.increment is not None else rates,
        gyro_bias=None if gyro_bias is None else (float(gyro_bias[0]), float(gyro_bias[1]), float(gyro_bias[2])),
        period=increments.period,
        row=record.row[index],
        time_s=increments.time_s[updated],
        attitude=attitude,
        error_rad=error,
        error_angle=np.linalg.norm(error, axis=1),
        heading=heading,
        tilt=tilt,
        provenance=run.provenance,
        files=run.files,
    )


def _algorithm_named(name: str) -> Algorithm:
    """The algorithm of a name; InputError where there is none."""
    known = {a.name: a for a in ALGORITHMS}
    if name not in known:
        raise InputError(f"algorithm '{name}' is not known; {nearest(name, tuple(known))}")
    return known[name]


def _check_range(
    record: StrapdownRecord, algorithm: Algorithm, increments: Increments, first: int, rate_divisor: int
) -> None:
    """Refuse a turn that is beyond the algorithm's valid range, by its row."""
    size = np.linalg.norm(increments.angle, axis=1)
    beyond = np.flatnonzero(size > algorithm.max_increment)
    if beyond.size:
        k = int(beyond[0])
        row = int(record.row[first + (k + 1) * rate_divisor])
        raise InputError(
            f"{record.path}, row {row}: a turn of {size[k]:.6g} rad in one sample; {algorithm.name} is valid to "
            f"{algorithm.max_increment:.3g} rad: sample faster or take mean-rate"
        )


def starting_attitude(record: StrapdownRecord) -> tuple[int, list[float]]:
    """Index of the row to begin at, and the attitude there."""
    if record.attitude is not None:
        known = np.flatnonzero(np.isfinite(record.attitude).all(axis=1))
        if known.size:
            first = int(known[0])
            return first, (record.attitude[first] / np.linalg.norm(record.attitude[first])).tolist()
    return 0, [1.0, 0.0, 0.0, 0.0]


def _scenario(record: StrapdownRecord, increments: Increments, number: int, start: list[float]) -> Scenario:
    """One attitude computer, driven by the record's increments."""
    time = increments.time_s
    columns = dict(zip(INCREMENT, increments.angle.T, strict=True))
    return Scenario(
        title=f"attitude of {record.path.name}",
        run=RunSetting(start_s=float(time[0]), stop_s=float(time[-1]), step_s=increments.period),
        fmus={
            "computer": FmuSetting(
                component="AttitudeComputer",
                parameters={
                    "algorithm": number,
                    "sample_period": increments.period,
                    "initial_attitude": start,
                },
            )
        },
        stimuli=[
            Stimulus(
                table=pl.DataFrame({"time_s": time[1:], **columns}),
                stamp="end",
                columns={f"computer.increment[{i}]": name for i, name in enumerate(INCREMENT, start=1)},
            )
        ],
        record=RecordSetting(
            columns={
                **{name: f"computer.attitude[{i}]" for i, name in enumerate(QUATERNION, start=1)},
                "updated": "computer.updated",
            }
        ),
    )


def _third_axis_is_vertical(record: StrapdownRecord) -> bool:
    """Whether the specific force, on average, points along the third axis of the true attitude's reference."""
    if record.attitude is None:
        return False
    known = np.isfinite(record.attitude).all(axis=1)
    if not known.any():
        return False
    mean = rotation_of(record.attitude[known]).apply(record.specific_force[known]).mean(axis=0)
    return bool(math.atan2(math.hypot(mean[0], mean[1]), mean[2]) <= VERTICAL_WITHIN)
