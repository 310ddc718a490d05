"""Whether a strapdown record can be judged at all: refused where it contradicts itself, and what it may lack."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..errors import InputError
from .bounds import gyro_noise
from .gravity_system import gravity_pieces
from .inspection import Inspection
from .sampling import rates_of
from .segments import broken_intervals, known_rows, window_segments
from .truth_system import FEWEST_WINDOWS, LENGTHS, window_parts
from .turning_check import FEWEST, LEAST_TURN, meaning

FEWEST_MOVES = 8
"""Fewer moves between rests cannot falsify 21 parameters of a block and leave some of them out."""
LEAST_SHARE = 0.5
"""Part of the true turns that the gyros must show before a swap or a flip is believed."""


def check_record(found: Inspection) -> None:
    """Refuse a record whose parts cannot belong together.

    Raises
    ------
    InputError
        one line: gyros in degrees per second, axes swapped, a wrong sign, a channel that is dead while the block moves
    """
    path = found.record.path
    said = list(truth_check(found)) or list(found.turning.said)
    if said:
        raise InputError(f"{path}: {'; '.join(said)}")
    moves = len(found.moves) or bool(found.excitation.any())
    dead = [name for name in found.sampling.dead if moves]
    if dead:
        raise InputError(f"{path}: {', '.join(dead)} never changes while the block moves: a dead channel")


def truth_check(found: Inspection) -> tuple[str, ...]:
    """What is wrong with the gyros beside the true attitude: units, order and signs of axes."""
    record = found.record
    known = known_rows(record)
    if record.attitude is None or not len(known):
        return ()
    windows = window_segments(known, broken_intervals(record, found.sampling), found.sampling.period, LENGTHS[0])
    if len(windows) < FEWEST:
        return ()
    rotation = Rotation.from_quat(np.roll(record.attitude[windows.first], -1, axis=1)).inv()
    true = (rotation * Rotation.from_quat(np.roll(record.attitude[windows.last], -1, axis=1))).as_rotvec()
    level = np.median(found.rests.rate, axis=0) if len(found.rests) else np.zeros(3)
    step = np.concatenate([[found.sampling.period], np.diff(record.time_s)])
    sums = np.cumsum((rates_of(record) - level) * step[:, None], axis=0)
    turn = sums[windows.last] - sums[windows.first]
    moving = np.linalg.norm(true, axis=1) > LEAST_TURN
    if moving.sum() < FEWEST:
        return ()
    design, target = turn[moving], true[moving]
    singular = np.linalg.svd(design, compute_uv=False)
    if singular[-1] < 0.02 * singular[0]:
        return ()
    matrix = np.linalg.lstsq(design, target, rcond=None)[0].T
    left = target - design @ matrix.T
    if float((left**2).sum()) > LEAST_SHARE * float((target**2).sum()):
        return ("the gyros do not turn as the true attitude does: is it body to reference, scalar first?",)
    error = np.sqrt(np.outer((left**2).mean(axis=0), np.diag(np.linalg.inv(design.T @ design))))
    said = (text.replace("of the accelerometers", "of the true attitude") for text in meaning(matrix, error))
    return tuple(text.replace("as gravity turns", "as the true attitude turns") for text in said)


def missing_things(found: Inspection, *, truth: bool) -> tuple[str, ...]:
    """What to add to a record that cannot be judged; nothing where it can."""
    if truth:
        windows = window_parts(found.record, broken_intervals(found.record, found.sampling), found.sampling.period)
        if not windows:
            return (
                f"the true attitude in {FEWEST_WINDOWS} windows of {LENGTHS[0]:g} s and more without a gap, in motion",
            )
        return ()
    return missing_at_rest(found)


def missing_at_rest(found: Inspection) -> tuple[str, ...]:
    """What a record without truth lacks."""
    rests, calibration = found.rests, found.accelerometers
    if not len(rests):
        return ("no rests: let the block rest for two seconds and more in each of a dozen poses",)
    if rests.force_bound is None or rests.rate_bound is None or not _noise_told(found):
        return ("the rests are too short to tell the noise: rest for two seconds and more in each pose",)
    if calibration is None or calibration.least_squares is None:
        poses = calibration.missing if calibration is not None else ()
        return tuple(f"a rest with {pose}" for pose in poses) or ("rests in a dozen poses",)
    if np.abs(calibration.least_squares).max() > 0.25:
        return ("rests whose readings are those of gravity alone: no accelerometers fit the present ones",)
    pieces = gravity_pieces(rests, broken_intervals(found.record, found.sampling))
    count = len(pieces.moves[0]) if pieces.moves else 0
    if count < FEWEST_MOVES:
        return (
            f"{count} moves from rest to rest without a gap or a saturated gyro; at least {FEWEST_MOVES} are needed, "
            "about every axis",
        )
    return ()


def _noise_told(found: Inspection) -> bool:
    rate: NDArray = rates_of(found.record)
    return gyro_noise(rate, found.rests, None, found.sampling.period, float(found.record.time_s[-1])) is not None
