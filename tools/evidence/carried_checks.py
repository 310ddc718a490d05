"""What a record of a block that is carried must have: it is refused in one line, or lacks something, or may be used."""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from ..motion.carry import rotation_of
from ..motion.inspect import Inspection
from ..motion.norm import norm_values
from ..motion.rest_noise import gyro_noise
from ..motion.rests import rates_of, rest_warnings
from ..motion.turning import FEWEST_WINDOWS as FEWEST_TURNS
from ..motion.turning import LEAST_MISS, LEAST_SHARE, LEAST_TURN, beside_truth
from ..records import StrapdownRecord
from ..records.channels import Channels
from .references import (
    FEWEST_WINDOWS,
    LENGTHS,
    gravity_pieces,
    has_truth,
    known_rows,
    truth_windows,
    usable_in,
    windows_of,
)

FEWEST_MOVES = 8
"""Fewer moves between rests cannot falsify 21 parameters of a block and leave some of them out."""
LEAST_DOWN = 0.9
"""So much of the specific force stands along −z of the true attitude's reference where that points down."""
LARGEST_TURN, FASTEST = 0.5, 0.99
"""Gyros and true attitude are compared over windows in which the block turns hardly more [rad], but for so few rows."""


def check_record(inspection: Inspection) -> None:
    """Refuse a record whose parts cannot belong together; one line says why.

    Gyros in degrees per second, axes swapped, a wrong sign, a channel that is dead while the block moves.
    """
    path = inspection.record.path
    if faults := wrong_channels(inspection):
        raise InputError(f"{path}: {'; '.join(faults)}")
    moves = len(inspection.moves) or bool(inspection.excitation.any())
    dead = [name for name in inspection.sampling.dead if moves]
    if dead:
        raise InputError(f"{path}: {', '.join(dead)} never changes while the block moves: a dead channel")


def wrong_channels(inspection: Inspection) -> tuple[str, ...]:
    """What is wrong with order, signs or units of channels, beside gravity or the true attitude, and what mends it."""
    faults = truth_check(inspection)
    if faults == () and inspection.turning.of_forces:
        return (
            "the gyros turn as the true attitude does and not as gravity: the accelerometers are exchanged, read them "
            f"with {inspection.turning.of_forces}",
        )
    return faults or inspection.turning.said


def downward_warning(record: StrapdownRecord) -> tuple[str, ...]:
    """Where the specific force points along −z of the reference: its z points down, or all accelerometers are reversed.

    Nothing else in a record can show that all are reversed, and nothing in this one which of the two it is; no line
    where a person has said how the channels are read.
    """
    rows = known_rows(record)
    if record.attitude is None or not len(rows) or record.channels is not None:
        return ()
    force = record.specific_force[rows]
    mean = rotation_of(record.attitude[rows]).apply(force).mean(axis=0)
    if not mean[2] < -LEAST_DOWN * float(np.median(np.linalg.norm(force, axis=1))):
        return ()
    mends = Channels((-1, -2, -3)).options[0]
    what = "the specific force points along -z of the true attitude's reference: its z points down, or all"
    return (f"{what} accelerometers are reversed (--channels {mends}); the record cannot tell which",)


def truth_check(inspection: Inspection) -> tuple[str, ...] | None:
    """What is wrong with the gyros beside the true attitude: units, order, signs of axes; None where it tells nothing.

    Rotations are compared, over windows in which the block turns little and over longer ones, in which gyros that lag
    follow better.
    """
    record = inspection.record
    rows = known_rows(record)
    if record.attitude is None or len(rows) < FEWEST_TURNS:
        return None
    turns = (rotation_of(record.attitude[rows[:-1]]).inv() * rotation_of(record.attitude[rows[1:]])).magnitude()
    speed = turns / np.diff(record.time_s[rows])
    seconds = LARGEST_TURN / max(float(np.quantile(speed, FASTEST)), LARGEST_TURN / LENGTHS[0])
    level = np.median(inspection.rests.rate, axis=0) if len(inspection.rests) else np.zeros(3)
    step = np.concatenate([[inspection.sampling.period], np.diff(record.time_s)])
    rate = rates_of(record) - level
    if record.rate is not None:
        rate[1:] = 0.5 * (rate[1:] + rate[:-1])
    comparisons = []
    for length in (seconds, LENGTHS[0]):
        # Rotations are bounded, so a few that are wrong do no harm; in degrees most seem to be more than half a turn.
        windows = windows_of(rows, usable_in(inspection, whole=False), inspection.sampling.period, length)
        if len(windows) < FEWEST_TURNS:
            continue
        ends = np.column_stack([windows.first, windows.last])
        true = turns_between(record.attitude, ends)
        moving = true.magnitude() > LEAST_TURN
        if moving.sum() >= FEWEST_TURNS:
            faults, missed = beside_truth(
                rate * step[:, None], true[moving], ends[moving], record.channels, record.time_s
            )
            comparisons.append((missed, faults, ends[moving]))
    if not comparisons:
        return None
    missed, faults, ends = min(comparisons, key=lambda comparison: comparison[0])
    if missed <= 1.0 - LEAST_SHARE:
        return faults
    return (f"the gyros do not turn as the true attitude does: {_meant(record.attitude, rate * step[:, None], ends)}",)


def _meant(attitude: NDArray, increments: NDArray, ends: NDArray) -> str:
    """What a true attitude (N, 4) may mean that the gyros do not follow; windows are rows (S, 2)."""
    ways = {
        "reference to body": attitude * [1.0, -1.0, -1.0, -1.0],
        "body to reference, scalar last": np.roll(attitude, 1, axis=1),
    }
    for name, axis in ways.items():
        if (
            beside_truth(increments, turns_between(axis, ends), ends, Channels(), np.zeros(len(attitude)))[1]
            < LEAST_MISS
        ):
            return f"they do where q0..q3 are {name}; give them body to reference, scalar first"
    return "is it body to reference, scalar first?"


def turns_between(attitude: NDArray, ends: NDArray) -> Rotation:
    """Turns (S) of a true attitude (N, 4), scalar first, between rows (S, 2), in body axes."""
    before, after = (rotation_of(attitude[rows]) for rows in ends.T)
    return before.inv() * after


def check_reference_bound(bound: float, inspection: Inspection) -> None:
    """Refuse a stated bound [arcmin] of the true attitude's error that is none, or for a record without true attitude.

    One line says why.
    """
    if not (math.isfinite(bound) and bound >= 0.0):
        raise InputError(f"--reference-bound {bound:g}: must be finite and not below 0, in arcminutes")
    if not has_truth(inspection):
        path = inspection.record.path
        raise InputError(f"{path}: --reference-bound is of a record with true attitude, and this one has none")


def warnings_of(inspection: Inspection) -> tuple[str, ...]:
    """What a person should know of a record and its sampling."""
    sampling, warnings = inspection.sampling, []
    for line in sampling.lines:
        warnings.append(f"{line}; moves with them are not used" if line.startswith("w") else line)
    warnings += rest_warnings(inspection.rests, inspection.gravity)
    if sampling.gaps:
        warnings.append(f"{len(sampling.gaps)} gaps, {sampling.missing} rows missing; moves over them are not used")
    return (*inspection.record.warnings, *warnings, *downward_warning(inspection.record))


def missing_things(inspection: Inspection) -> tuple[str, ...]:
    """What to add to a record that cannot be judged; nothing where it can."""
    rests, calibration = inspection.rests, inspection.accelerometers
    noise = gyro_noise(inspection.record, rests, inspection.sampling.period)
    if has_truth(inspection):
        if truth_windows(inspection):
            return (
                ()
                if noise is not None
                else ("a rest of two seconds and more: nothing else tells the noise of the gyros",)
            )
        return (f"the true attitude in {FEWEST_WINDOWS} windows of {LENGTHS[0]:g} s and more without a gap, in motion",)
    if not len(rests):
        return ("no rests: let the block rest for two seconds and more in each of a dozen poses",)
    if rests.force_bound is None or noise is None:
        return ("the rests are too short to tell the noise: rest for two seconds and more in each pose",)
    values = norm_values(calibration)
    if values is None:
        poses = [direction.close_by for direction in calibration.open] if calibration is not None else []
        return tuple(f"a rest with {pose}" for pose in poses) or ("rests in a dozen poses",)
    if np.abs(values).max() > 0.25:
        return ("rests whose readings are those of gravity alone: no accelerometers fit the present ones",)
    moves = gravity_pieces(inspection)[1]
    count = len(moves[0]) if moves else 0
    if count < FEWEST_MOVES:
        return (
            f"{count} moves from rest to rest without a gap, a knock or a saturated gyro; at least {FEWEST_MOVES} are "
            "needed, about every axis",
        )
    return ()
