"""From a strapdown record to its linear system: the simulation is run, and run again about the calibrated block."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace
from .bounds import GyroNoise, force_deviation, gyro_noise
from .carrying import GyroModel, carried_attitude
from .gravity_system import GravityPieces, gravity_parts, gravity_pieces, poses_of
from .inspection import Inspection
from .motion import Motion, motion_of
from .norm_calibration import LARGEST, NAMES, inputs_of
from .sampling import rates_of
from .segments import Segments, all_rows, broken_intervals
from .signatures import integrals, means_at_rest
from .system import System, weighted_step
from .truth_system import truth_parts, window_parts

BIAS = EffectPlace("gyro-bias", "gyro-block")
SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
RELINEARISATIONS, LONG = 2, 1_000_000
"""Runs of the simulation before the last one, each about the fit to the one before; one for records of more rows."""
LEAST_FORCE = 1e-9
"""Bounds of means [g] are not taken for less."""


@dataclass(frozen=True, eq=False)
class Built:
    """A record's system and what it was made from.

    Attributes
    ----------
    system : System
    own : tuple of EffectPlace
        the gyros' part of the baseline
    motion : Motion
    model : GyroModel
        about which the system is linear
    attitude : (N, 4) array
        carried with it
    noise : GyroNoise or None
    pieces : GravityPieces or list of Segments
    at_rest : (3, K) array or None
        what each coefficient adds to the mean at rest that is taken out [rad/s]; None where the bias is free
    """

    system: System
    own: tuple[EffectPlace, ...]
    motion: Motion
    model: GyroModel
    attitude: NDArray[np.float64]
    noise: GyroNoise | None
    pieces: "GravityPieces | list[Segments]"
    at_rest: NDArray[np.float64] | None

    @property
    def forces(self) -> bool:
        """Whether gravity is the reference: the accelerometers' parameters then belong to the baseline."""
        return isinstance(self.pieces, GravityPieces)


def gyro_places(motion: Motion, baseline: Sequence[EffectPlace]) -> list[EffectPlace]:
    """Effects of the gyros that can be tried beside those of the baseline."""
    tried = []
    for effect in STRAPDOWN_EFFECTS.values():
        told = "temperature" not in effect.needs or motion.temperature is not None
        if told and effect.variants is None:
            tried += [place for place in effect.places if place not in baseline]
    return tried


def force_places(temperature: NDArray | None) -> list[EffectPlace]:
    """Linear static effects of the accelerometers."""
    tried = []
    for effect in POSITION_EFFECTS.values():
        told = "temperature" not in effect.needs or temperature is not None
        if effect.component == "AccelerometerBlock" and effect.variants is None and told and effect.untold is None:
            tried += list(effect.places)
    return tried


def not_searched(built: Built) -> tuple[EffectPlace, ...]:
    """Effects on the block that a record of this kind does not show: they are not searched."""
    own = (*built.own, *built.system.places)
    components = ("GyroBlock", "AttitudeComputer", "AccelerometerBlock")
    every = (p for e in CATALOGUE.values() if e.component in components for p in e.places)
    return tuple(place for place in every if place not in own)


def baseline_names(places: Sequence[EffectPlace], *, forces: bool) -> tuple[tuple[str, str], ...]:
    """Names and units of the baseline's parameters: the accelerometers' nine where gravity is the reference."""
    names = [(f"accelerometer {n}", "g" if n.startswith("bias") else "1") for n in NAMES] if forces else []
    for place in places:
        names += [(f"gyro {p.name}", p.unit) for p in CATALOGUE[place.effect].at(place).parameters]
    return tuple(names)


def with_parameters(model: GyroModel, places: Sequence[EffectPlace], step: NDArray) -> GyroModel:
    """The gyros with steps (3,) or (9,) of bias, scale and misalignment added, in the order of the places."""
    bias, scale, at = model.bias, model.scale_misalignment, 0
    for place in places:
        if place == BIAS:
            bias, at = bias + step[at : at + 3], at + 3
        else:
            scale, at = scale + step[at : at + 9], at + 9
    return GyroModel(bias, scale, model.effects)


def within_instruments(model: GyroModel) -> GyroModel:
    """The model with scale factors and misalignments that an instrument has; where a fit wants others, it is wrong."""
    return replace(model, scale_misalignment=np.clip(model.scale_misalignment, -LARGEST, LARGEST))


def build_with_gravity(found: Inspection, baseline: str, rates: str) -> Built:
    """The system of a record whose reference is gravity; its accelerometers are calibrated by their norm.

    Parameters
    ----------
    found : Inspection
        with a consistent or falsified norm calibration
    baseline : "calibrated" or "nominal"
        whether the gyros' scale factors and misalignments belong to the baseline, beside their bias
    rates : str
        as for `motion_of`
    """
    record, rests, calibration = found.record, found.rests, found.accelerometers
    assert calibration is not None
    assert calibration.least_squares is not None
    assert rests.force_bound is not None
    motion = motion_of(record, found.sampling, found.gravity, rates)
    own = [BIAS, SCALE] if baseline == "calibrated" else [BIAS]
    pieces = gravity_pieces(rests, broken_intervals(record, found.sampling))
    model, x = GyroModel(bias=rest_mean(found)), calibration.least_squares
    up = inputs_of(x, rests.force / found.gravity)
    span = float(motion.time_s[-1] - motion.time_s[0])
    noise = gyro_noise(rates_of(record), rests, up, motion.period, span)
    assert noise is not None
    own_noise = force_deviation(record.specific_force, rests, motion.period, span)
    deviation = np.maximum(own_noise / found.gravity, LEAST_FORCE)
    width = sum(len(CATALOGUE[p.effect].at(p).parameters) for p in own)
    system = attitude = None
    for last in [False] * relinearisations(motion) + [True]:
        gyros = gyro_places(motion, own) if last else []
        forces = force_places(motion.temperature) if last else []
        # An hour's attitudes are large: those of the run before go first.
        attitude = None
        attitude = carried_attitude(motion, model, found.gravity)
        integral = integrals(motion, model, attitude, [*own, *gyros], pieces.rows)
        poses = poses_of(x, rests, deviation, found.gravity, forces)
        parts = gravity_parts(pieces, poses, rests, attitude, integral, width, noise, motion.time_s)
        point = np.concatenate([x, *_values(model, own)])
        places = (*gyros, *forces)
        system = System(tuple(parts), baseline_names(own, forces=True), point, places, blocks_of(places))
        if not last:
            step = weighted_step(system.nominal, system.residual)
            x, model = x + step[: len(NAMES)], within_instruments(with_parameters(model, own, step[len(NAMES) :]))
    assert system is not None
    assert attitude is not None
    return Built(system, tuple(own), motion, model, attitude, noise, pieces, None)


def build_with_truth(found: Inspection, baseline: str, rates: str) -> Built:
    """The system of a record with true attitude; arguments as for `build_with_gravity`.

    The nominal block is taken as it is delivered: the mean at rest is taken out and nothing else.
    """
    record, rests = found.record, found.rests
    assert record.attitude is not None
    motion = motion_of(record, found.sampling, found.gravity, rates)
    own = [BIAS, SCALE] if baseline == "calibrated" else []
    windows = window_parts(record, broken_intervals(record, found.sampling), motion.period)
    rows = all_rows(windows)
    up = rests.force / found.gravity if len(rests) else None
    noise = gyro_noise(rates_of(record), rests, up, motion.period, float(motion.time_s[-1] - motion.time_s[0]))
    model = GyroModel(bias=rest_mean(found))
    width = sum(len(CATALOGUE[p.effect].at(p).parameters) for p in own)
    at_rest = np.zeros((3, sum(len(CATALOGUE[p.effect].at(p).parameters) for p in gyro_places(motion, own))))
    system = attitude = None
    for last in [False] * (relinearisations(motion) if own else 0) + [True]:
        gyros = gyro_places(motion, own) if last else []
        # An hour's attitudes are large: those of the run before go first.
        attitude = None
        attitude = carried_attitude(motion, model, found.gravity)
        integral = integrals(motion, model, attitude, [*own, *gyros], rows)
        if not own:
            # What an effect adds to the mean at rest is taken out with it; but for the bias of the motion alone.
            others = [place for place in gyros if place != BIAS]
            columns = np.concatenate([np.arange(b.start, b.stop) for b in picked(gyros, others)])
            at_rest[:, columns] = means_at_rest(motion, model, others, rests.rows)
            integral = integral - integral[..., picked(gyros, [BIAS])[0]] @ at_rest
        parts = truth_parts(windows, record.attitude, rests, attitude, rows, integral, width, noise, motion.time_s)
        point = np.concatenate([np.zeros(0), *_values(model, own)])
        system = System(tuple(parts), baseline_names(own, forces=False), point, tuple(gyros), blocks_of(gyros))
        if not last:
            matrix = np.concatenate([part.nominal.reshape(-1, width) for part in parts])
            error = np.concatenate([part.error.ravel() for part in parts])
            model = within_instruments(with_parameters(model, own, weighted_step(matrix, error)))
    assert system is not None
    assert attitude is not None
    return Built(system, tuple(own), motion, model, attitude, noise, windows, at_rest)


def relinearisations(motion: Motion) -> int:
    """How often the simulation is run to come near the calibrated block."""
    return RELINEARISATIONS if len(motion) <= LONG else 1


def rest_mean(found: Inspection) -> NDArray[np.float64]:
    """The gyros' mean reading over all rests (3,) [rad/s]; zeros where there are none."""
    if not len(found.rests):
        return np.zeros(3)
    lengths = np.array([rows.stop - rows.start for rows in found.rests.rows], dtype=float)
    return lengths @ found.rests.rate / lengths.sum()


def picked(places: Sequence[EffectPlace], wanted: Sequence[EffectPlace]) -> list[slice]:
    """The columns of some of the effects."""
    blocks = dict(zip(places, blocks_of(places), strict=True))
    return [blocks[place] for place in wanted]


def blocks_of(places: Sequence[EffectPlace]) -> tuple[slice, ...]:
    """The columns of each effect, one after the other."""
    blocks, start = [], 0
    for place in places:
        blocks.append(slice(start, start + len(CATALOGUE[place.effect].at(place).parameters)))
        start = blocks[-1].stop
    return tuple(blocks)


def _values(model: GyroModel, own: Sequence[EffectPlace]) -> list[NDArray]:
    return [model.bias if place == BIAS else model.scale_misalignment for place in own]
