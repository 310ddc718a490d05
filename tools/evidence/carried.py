"""Evidence of a block that is carried by hand, or beside the true attitude.

The simulation, FMUs of gyro block and attitude computer, carries the attitude through the record; what it misses at the
ends of moves or windows is the evidence. It is run again about the calibrated block, and about one large effect.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace
from ..bounded.spaces import least_squares
from ..errors import InputError
from ..motion.carry import GyroModel, Motion, carried_attitude, motion_of
from ..motion.inspect import FEWEST_WINDOWS as FEWEST_TURNS
from ..motion.inspect import LEAST_TURN, Inspection, meaning
from ..motion.norm import LARGEST, NAMES, inputs_of
from ..motion.sampling import rates_of
from .carried_bounds import force_deviation, gyro_noise
from .evidence import DETERMINED, Evidence, coefficient_count
from .references import (
    FEWEST_WINDOWS,
    LENGTHS,
    Gravity,
    Run,
    Truth,
    Usable,
    gravity_pieces,
    integrals,
    known_rows,
    means_at_rest,
    rotation_vectors,
    truth_windows,
    turned,
    windows_of,
)

BIAS = EffectPlace("gyro-bias", "gyro-block")
SCALE = EffectPlace("gyro-scale-misalignment", "gyro-block")
COMPONENTS = ("GyroBlock", "AttitudeComputer", "AccelerometerBlock")
RELINEARISATIONS, LONG = 2, 1_000_000
"""Runs of the simulation before the last one, each about the fit to the one before; one for records of more rows."""
LEAST_FORCE = 1e-9
"""Bounds of means [g] are not taken for less."""
LIMIT = 1.0 + 1e-7
"""Radius up to which a model stands: one, and what the programmes may be wrong by."""
MANY = 4.0
"""Errors of so many bounds, root mean square over that of noise at its bound, may hold a second order that counts."""
MOST_OF_IT = 3.0
"""By so much an effect must lower the errors to be the main one."""
JUMP, ROUNDS_OF_JUMPS = 12.0, 6
"""A window with so many times the median error that all effects leave is a jump; jumps are dropped in rounds."""
ROOM = 1.2
"""A bound over the largest error that was seen: there are only so many windows."""
FEWEST_MOVES = 8
"""Fewer moves between rests cannot falsify 21 parameters of a block and leave some of them out."""
LEAST_SHARE = 0.5
"""Part of the true turns that the gyros must show before a swap or a flip is believed."""
RECORD_NOISE = "the noise of gyros and accelerometers at rest (Allan deviation), and Earth's rate"
WITH_TRUTH = "the noise of the gyros and the scatter of the true attitude at rest, and Earth's rate"
LEFT_OUT = (
    "the largest errors that all effects together leave in parts of the record that were left out: the noise at rest "
    "is smaller, so the true attitude errs more in motion than at rest, or something is not in the catalogue"
)


@dataclass(frozen=True, eq=False)
class Carried(Evidence):
    """Evidence of a carried block, and what it was made from.

    Attributes
    ----------
    found : Inspection
        of the record
    own : tuple of EffectPlace
        the gyros' part of the model's parameters
    motion : Motion
    model : GyroModel
        about which the rows are linear
    attitude : (N, 4) array
        carried with it
    reference : Gravity or Truth
    at_rest : (3, K) array or None
        what each coefficient adds to the mean at rest that is taken out [rad/s]; None where the bias is free
    """

    found: Inspection
    own: tuple[EffectPlace, ...]
    motion: Motion
    model: GyroModel
    attitude: NDArray[np.float64]
    reference: Gravity | Truth
    at_rest: NDArray[np.float64] | None

    @property
    def of_forces(self) -> int:
        """How many of the parameters are the accelerometers': nine where gravity is the reference."""
        return len(self.names) - sum(coefficient_count(place) for place in self.own)

    @property
    def quoted(self) -> int:
        """Number of the part whose errors are quoted: single moves, or the windows of the middle length."""
        return self.scored[0 if isinstance(self.reference, Gravity) else len(self.scored) // 2]

    @property
    def not_searched(self) -> tuple[EffectPlace, ...]:
        """Effects on the block that a record of this kind does not show."""
        every = (p for e in CATALOGUE.values() if e.component in COMPONENTS for p in e.places)
        return tuple(place for place in every if place not in (*self.own, *self.places))

    def quantities(self) -> dict[str, NDArray[np.float64]]:
        """What the errors of the quoted pieces may depend on: (S, k) each.

        ``rate``: mean rate about each axis; ``turn``: its integral; ``orientation``: specific force at the beginning;
        ``time``; ``temperature`` where the record has it.
        """
        motion, pieces = self.motion, self.parts[self.quoted].pieces
        sums = np.cumsum((motion.rate - self.model.bias) * motion.step[:, None], axis=0)
        turn = sums[pieces.last] - sums[pieces.first]
        force = motion.force(pieces.first)
        found = {
            "rate": turn / pieces.durations(motion.time_s)[:, None],
            "turn": turn,
            "orientation": force / np.maximum(np.linalg.norm(force, axis=1), 1e-12)[:, None],
            "time": motion.time_s[pieces.first][:, None],
        }
        if motion.temperature is not None:
            found["temperature"] = motion.temperature[pieces.first][:, None]
        return found

    def about_axes(self, error: NDArray) -> NDArray[np.float64]:
        """Errors (S, d) of the quoted pieces as vectors (S, 3) about the block's axes, or along them."""
        if isinstance(self.reference, Truth):
            return error
        up = self.reference.directions(self.point[: len(NAMES)])
        return np.einsum("skp,sk->sp", self.reference.across(0, up), error)

    def gyros_with(
        self, step: NDArray, effects: Mapping[EffectPlace, tuple[float, ...]], coefficients: NDArray
    ) -> GyroModel:
        """The gyros with a step of the model's parameters and effects of such sizes.

        Parameters
        ----------
        step : (P,) array
        effects : mapping
            effect -> values of its parameters
        coefficients : (k,) array
            the same as coefficients
        """
        gyros = with_parameters(self.model, self.own, step[self.of_forces :])
        bias = gyros.bias
        if self.at_rest is not None:
            bias = bias - self.at_rest[:, self.numbers_of(tuple(effects))] @ coefficients
        own = {place: values for place, values in effects.items() if is_of_gyros(place)}
        return GyroModel(bias, gyros.scale_misalignment, own)

    def main_effect(self) -> EffectPlace | None:
        """The gyros' effect that alone makes most of large errors; None where there is none."""
        before = self._rms_left(())
        if not before > MANY / np.sqrt(3.0):
            return None
        left = {place: self._rms_left((place,)) for place in self.places if is_of_gyros(place)}
        best = min(left, key=lambda place: left[place], default=None)
        return best if best is not None and MOST_OF_IT * left[best] < before else None

    def _rms_left(self, places: Sequence[EffectPlace]) -> float:
        """Root mean square of what least squares leaves, in bounds."""
        matrix = self.matrix(places)
        left = self.residual - matrix @ self.estimate(places) if matrix.shape[1] else self.residual
        return float(np.sqrt(np.mean(left**2)))

    def errors_along(self, attitude: NDArray, step: NDArray) -> list[NDArray[np.float64]]:
        """Errors of each part with another attitude and a step of the model's parameters; norms stay."""
        if isinstance(self.reference, Truth):
            return [self.reference.errors(k, turned(part.pieces, attitude)) for k, part in enumerate(self.parts)]
        reference, x = self.reference, self.point[: len(NAMES)]
        first, up = reference.directions(x), reference.directions(x + step[: len(NAMES)])
        errors = []
        for part in self.parts:
            if part.pieces.kind == "norms":
                errors.append(part.error)
            elif part.pieces.kind == "rests":
                errors.append(rotation_vectors(turned(part.pieces, attitude)))
            else:
                number = reference.scored.index(part.pieces)
                apart = reference.errors(number, turned(part.pieces, attitude), up)
                errors.append(np.einsum("skp,sp->sk", reference.across(number, first), apart))
        return errors


def is_of_gyros(place: EffectPlace) -> bool:
    """Whether an effect is carried with the attitude; others change what the accelerometers say at rest."""
    return CATALOGUE[place.effect].component != "AccelerometerBlock"


def gyro_places(motion: Motion, own: Sequence[EffectPlace]) -> list[EffectPlace]:
    """Effects of the gyros that can be tried beside those of the model."""
    told = [e for e in STRAPDOWN_EFFECTS.values() if "temperature" not in e.needs or motion.temperature is not None]
    return [place for effect in told if effect.variants is None for place in effect.places if place not in own]


def force_places(motion: Motion) -> list[EffectPlace]:
    """Linear static effects of the accelerometers."""
    told = [e for e in POSITION_EFFECTS.values() if "temperature" not in e.needs or motion.temperature is not None]
    own = [e for e in told if e.component == "AccelerometerBlock" and e.variants is None and e.untold is None]
    return [place for effect in own for place in effect.places]


def with_parameters(model: GyroModel, places: Sequence[EffectPlace], step: NDArray) -> GyroModel:
    """The gyros with steps (3,) or (9,) of bias, scale and misalignment added, in the order of the places."""
    bias, scale, at = model.bias, model.scale_misalignment, 0
    for place in places:
        if place == BIAS:
            bias, at = bias + step[at : at + 3], at + 3
        else:
            scale, at = scale + step[at : at + 9], at + 9
    return GyroModel(bias, scale, model.effects)


def carried_evidence(found: Inspection, baseline: str, rates: str = "instantaneous") -> Carried:
    """The evidence of a record, about its calibrated block; against the true attitude where the record has it.

    Parameters
    ----------
    found : Inspection
        without true attitude: with a consistent or falsified norm calibration
    baseline : "calibrated" or "nominal"
        whether the gyros' scale factors and misalignments are parameters; beside their bias, but with true attitude,
        where the nominal block is taken as it is delivered: the mean at rest is taken out and nothing else
    rates : str
        as for `motion_of`
    """
    motion = motion_of(found.record, found.sampling, found.gravity, rates)
    reference = truth_reference(found) if has_truth(found) else gravity_reference(found)
    gravity = isinstance(reference, Gravity)
    own = [BIAS, SCALE] if baseline == "calibrated" else [BIAS] if gravity else []
    model = GyroModel(bias=rest_mean(found))
    x, forces, names = np.zeros(0), [], []
    if gravity:
        assert found.accelerometers is not None
        assert found.accelerometers.least_squares is not None
        x, forces = found.accelerometers.least_squares, force_places(motion)
        names = [(f"accelerometer {n}", "g" if n.startswith("bias") else "1") for n in NAMES]
    names += [(f"gyro {p.name}", p.unit) for place in own for p in CATALOGUE[place.effect].at(place).parameters]
    at_rest, made, before_last = None, None, (RELINEARISATIONS if len(motion) <= LONG else 1) if own else 0
    for number in range(before_last + 1):
        last = number == before_last
        gyros, tried = (gyro_places(motion, own), forces) if last else ([], [])
        # An hour's attitudes are large: those of the run before go first.
        made = None
        attitude = carried_attitude(motion, model, found.gravity)
        integral = integrals(motion, model, attitude, [*own, *gyros], reference.rows)
        if not own:
            at_rest = added_at_rest(found, motion, model, gyros)
            integral = integral - integral[..., _columns(gyros, [BIAS])] @ at_rest
        run = Run(attitude, reference.rows, integral, len(names) - len(x))
        parts = reference.parts(run, x, tried, motion.time_s) if gravity else reference.parts(run, motion.time_s)
        values = [model.bias if place == BIAS else model.scale_misalignment for place in own]
        point = np.concatenate([x, *values])
        made = Carried(
            tuple(parts), tuple(names), point, (*gyros, *tried), found, tuple(own), motion, model, attitude, reference,
            None if gravity else at_rest,
        )  # fmt: skip
        if not last:
            # Of true attitude the bounds may not be known yet.
            weighed = made if gravity else made.unweighted()
            step = least_squares(weighed.nominal, weighed.residual, DETERMINED)
            x, model = x + step[: len(x)], with_parameters(model, own, step[len(x) :])
            # Where a fit wants what no instrument has, it is wrong.
            model = replace(model, scale_misalignment=np.clip(model.scale_misalignment, -LARGEST, LARGEST))
    assert made is not None
    return made


def has_truth(found: Inspection) -> bool:
    """Whether a record holds the true attitude anywhere."""
    return len(known_rows(found.record)) > 0


def gravity_reference(found: Inspection) -> Gravity:
    """Gravity as the reference of a record whose accelerometers are calibrated by their norm."""
    rests, calibration = found.rests, found.accelerometers
    assert calibration is not None
    assert calibration.least_squares is not None
    reading = rests.force / found.gravity
    noise = gyro_noise(found, inputs_of(calibration.least_squares, reading))
    assert noise is not None
    deviation = np.maximum(force_deviation(found) / found.gravity, LEAST_FORCE)
    return Gravity(rests, reading, deviation, noise, *gravity_pieces(rests, Usable(found)))


def truth_reference(found: Inspection) -> Truth:
    """The true attitude of a record as the reference."""
    assert found.record.attitude is not None
    up = found.rests.force / found.gravity if len(found.rests) else None
    return Truth(found.rests, found.record.attitude, gyro_noise(found, up), truth_windows(found, Usable(found)))


def rest_mean(found: Inspection) -> NDArray[np.float64]:
    """The gyros' mean reading over all rests (3,) [rad/s]; zeros where there are none."""
    if not len(found.rests):
        return np.zeros(3)
    lengths = np.array([rows.stop - rows.start for rows in found.rests.rows], dtype=float)
    return lengths @ found.rests.rate / lengths.sum()


def added_at_rest(
    found: Inspection, motion: Motion, model: GyroModel, places: Sequence[EffectPlace]
) -> NDArray[np.float64]:
    """What each coefficient (3, K) adds to the mean at rest that is taken out; that of the bias adds none."""
    others = [place for place in places if place != BIAS]
    added = np.zeros((3, sum(coefficient_count(place) for place in places)))
    if others:
        added[:, _columns(places, others)] = means_at_rest(motion, model, others, found.rests.rows)
    return added


def _columns(places: Sequence[EffectPlace], wanted: Sequence[EffectPlace]) -> NDArray[np.int_]:
    """The columns of some of the effects."""
    return Evidence((), (), np.zeros(0), tuple(places)).numbers_of(wanted)


def about_main_effect(made: Carried) -> Carried:
    """The evidence about the effect that makes most of its errors; as it is where none does.

    Signatures are of first order. Where one effect makes nearly all of errors that are many times their bounds, its
    second order may be above them too.
    """
    even = made
    if not all((part.bound > 0.0).all() for part in made.parts):
        least = float(np.median(np.abs(made.parts[0].error))) + 1e-12
        even = made.with_bounds([np.maximum(part.bound, least) for part in made.parts])
    place = even.main_effect()
    if place is None:
        return made
    solution = even.estimate([place])
    parameters = CATALOGUE[place.effect].at(place).parameters
    values = even.values_of([place], solution)[place]
    possible = all(p.possible(v) for p, v in zip(parameters, values, strict=True))
    return about_effects(made, [place], solution) if possible else made


def about_effects(made: Carried, places: Sequence[EffectPlace], solution: NDArray) -> Carried:
    """The evidence about effects of the gyros of such sizes: the second order of their run is in the errors.

    The errors are those of a run with the effects, and what these do to first order is added again: as if they acted
    linearly.

    Parameters
    ----------
    made : Carried
    places : sequence of EffectPlace
    solution : (P + k,) array
        steps of the model's parameters and the effects' coefficients
    """
    count = len(made.names)
    step, size = solution[:count], solution[count:]
    model = made.gyros_with(step, made.values_of(places, solution), size)
    attitude = carried_attitude(made.motion, model, made.found.gravity)
    columns = np.concatenate([np.arange(count), count + made.numbers_of(places)])
    errors = [
        part.error
        if part.pieces.kind == "norms"
        else error + np.concatenate([part.nominal, part.columns], axis=-1)[..., columns] @ solution
        for part, error in zip(made.parts, made.errors_along(attitude, step), strict=True)
    ]
    return made.with_errors(errors)


def with_reference_errors(made: Carried) -> tuple[Carried, str, tuple[str, ...]]:
    """Evidence with bounds that the true attitude's own errors allow, what they come from, and warnings.

    Where all effects together cannot bring the errors within the noise at rest, no set of them can: then what they
    leave in blocks that are left out is the bound, for each length of windows. Windows with errors many times those of
    the others, which nothing in the catalogue makes, are not used.
    """
    if isinstance(made.reference, Gravity):
        return made, RECORD_NOISE, ()
    if all((part.bound > 0.0).all() for part in made.parts) and made.refit(made.places).radius <= LIMIT:
        return made, WITH_TRUTH, ()
    kept = [np.ones(len(part), dtype=bool) for part in made.parts]
    for _ in range(ROUNDS_OF_JUMPS):
        sizes = [np.linalg.norm(error, axis=1) for error in left_out_by_all(of_windows(made, kept))]
        far = [size > JUMP * np.median(size) for size in sizes]
        if not any(mask.any() for mask in far):
            break
        for mine, mask in zip(kept, far, strict=True):
            mine[np.flatnonzero(mine)[mask]] = False
    said = tuple(
        f"{np.count_nonzero(~mine)} windows of {part.label} are not used: gyros or truth jump there as no effect does"
        for mine, part in zip(kept, made.parts, strict=True)
        if not mine.all()
    )
    made = of_windows(made, kept)
    largest = [ROOM * np.abs(error).max() for error in left_out_by_all(made)]
    bounds = [np.maximum(part.bound, most) for part, most in zip(made.parts, largest, strict=True)]
    return made.with_bounds(bounds), LEFT_OUT, said


def left_out_by_all(made: Carried) -> list[NDArray[np.float64]]:
    """Errors (S, d) of each part that all effects together leave in blocks that are left out [rad]."""
    even = made.unweighted()
    return even.split(even.left_out(even.places, even.folds()))


def of_windows(made: Carried, kept: Sequence[NDArray]) -> Carried:
    """The windows that masks (S,) choose, of each length."""
    parts = tuple(part.selected(mask) for part, mask in zip(made.parts, kept, strict=True))
    scored = tuple(part.pieces for part in parts)
    return replace(made, parts=parts, reference=replace(made.reference, scored=scored))


def check_record(found: Inspection) -> None:
    """Refuse a record whose parts cannot belong together.

    Raises
    ------
    InputError
        one line: gyros in degrees per second, axes swapped, a wrong sign, a channel that is dead while the block moves
    """
    path = found.record.path
    said = truth_check(found) or found.turning.said
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
    windows = windows_of(known, Usable(found), found.sampling.period, LENGTHS[0])
    if len(windows) < FEWEST_TURNS:
        return ()
    rotation = Rotation.from_quat(np.roll(record.attitude[windows.first], -1, axis=1)).inv()
    true = (rotation * Rotation.from_quat(np.roll(record.attitude[windows.last], -1, axis=1))).as_rotvec()
    level = np.median(found.rests.rate, axis=0) if len(found.rests) else np.zeros(3)
    step = np.concatenate([[found.sampling.period], np.diff(record.time_s)])
    sums = np.cumsum((rates_of(record) - level) * step[:, None], axis=0)
    turn = sums[windows.last] - sums[windows.first]
    moving = np.linalg.norm(true, axis=1) > LEAST_TURN
    if moving.sum() < FEWEST_TURNS:
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


def missing_things(found: Inspection) -> tuple[str, ...]:
    """What to add to a record that cannot be judged; nothing where it can."""
    rests, calibration = found.rests, found.accelerometers
    if has_truth(found):
        if truth_windows(found, Usable(found)):
            return ()
        return (f"the true attitude in {FEWEST_WINDOWS} windows of {LENGTHS[0]:g} s and more without a gap, in motion",)
    if not len(rests):
        return ("no rests: let the block rest for two seconds and more in each of a dozen poses",)
    if rests.force_bound is None or rests.rate_bound is None or gyro_noise(found, None) is None:
        return ("the rests are too short to tell the noise: rest for two seconds and more in each pose",)
    if calibration is None or calibration.least_squares is None:
        poses = calibration.missing if calibration is not None else ()
        return tuple(f"a rest with {pose}" for pose in poses) or ("rests in a dozen poses",)
    if np.abs(calibration.least_squares).max() > 0.25:
        return ("rests whose readings are those of gravity alone: no accelerometers fit the present ones",)
    moves = gravity_pieces(rests, Usable(found))[1]
    count = len(moves[0]) if moves else 0
    if count < FEWEST_MOVES:
        return (
            f"{count} moves from rest to rest without a gap or a saturated gyro; at least {FEWEST_MOVES} are needed, "
            "about every axis",
        )
    return ()
