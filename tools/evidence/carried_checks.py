"""Checks of a strapdown record: refuse it in one line, name the missing data, or let it pass."""

import math

import numpy as np

from ..errors import InputError
from ..motion.inspect import Inspection
from ..motion.norm import norm_values
from ..motion.rest_noise import gyro_noise
from ..motion.rests import rest_warnings
from .references import (
    FEWEST_WINDOWS,
    LENGTHS,
    gravity_pieces,
    has_truth,
    truth_windows,
)

FEWEST_MOVES = 8
"""Fewer moves between rests cannot falsify 21 parameters of a block and leave some of them out."""


def check_record(inspection: Inspection) -> None:
    """Refuse a record with a dead channel while the block moves."""
    path = inspection.record.path
    moves = len(inspection.moves) or bool(inspection.excitation.any())
    dead = [name for name in inspection.sampling.dead if moves]
    if dead:
        raise InputError(f"{path}: {', '.join(dead)} never changes while the block moves: a dead channel")


def check_reference_bound(bound: float, inspection: Inspection) -> None:
    """Refuse an impossible bound [arcmin] of the true attitude's error, or one for a record without true attitude.

    The error has one line.
    """
    if not (math.isfinite(bound) and bound >= 0.0):
        raise InputError(f"--reference-bound {bound:g}: must be finite and not below 0, in arcminutes")
    if not has_truth(inspection):
        path = inspection.record.path
        raise InputError(f"{path}: --reference-bound is of a record with true attitude, and this one has none")


def warnings_of(inspection: Inspection) -> tuple[str, ...]:
    """Return the warnings of a record and its sampling."""
    sampling, warnings = inspection.sampling, []
    for line in sampling.lines:
        warnings.append(f"{line}; moves with them are not used" if line.startswith("w") else line)
    warnings += rest_warnings(inspection.rests, inspection.gravity)
    if sampling.gaps:
        warnings.append(f"{len(sampling.gaps)} gaps, {sampling.missing} rows missing; moves over them are not used")
    return (*inspection.record.warnings, *warnings)


def missing_things(inspection: Inspection) -> tuple[str, ...]:
    """Return the data to add to a record that cannot be judged; nothing for one that can."""
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
    if rests.force_scatter is None or noise is None:
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
