"""The way from a strapdown record to its evidence: the record is refused, lacks something, or is used.

The simulation is run about the calibrated block, and once more about one large effect.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ...models.effects import POSITION_EFFECTS, STRAPDOWN_EFFECTS, Effect, EffectPlace
from ..bounded.work import Work
from ..errors import InputError
from ..memory import keeping
from ..motion.carry import GyroModel, Motion, TurnsTooFar, carried_attitude, mean_motion
from ..motion.inspect import Inspection, inspect_record
from ..motion.norm import LARGEST, NAMES, inputs_of, norm_equations, norm_values
from ..motion.rest_noise import gyro_noise, rest_lengths
from ..records import StrapdownRecord
from ..records.limits import resolution_of
from ..rounding import exactly
from .carried import LATENCY, SCALE, CarriedReader, RecordReader
from .carried_checks import check_record, check_reference_bound, missing_things, warnings_of
from .carried_run import BIAS, LONG, Carried, is_of_gyros, with_parameters
from .cells_in_motion import SEARCHED
from .evidence import Evidence, Linear, ReadOff, Source, linear_fit
from .fit import ARCMIN, are_possible, blocks_of, contains, robust_estimate, width_of
from .references import (
    Gravity,
    Run,
    Truth,
    factor_for,
    force_deviation,
    gravity_pieces,
    has_truth,
    integrals,
    is_inertial,
    means_at_rest,
    truth_scatter,
    truth_windows,
    without_earth,
)
from .rows import Part, Pieces, Rows

BASELINES = ("calibrated", "nominal")
RELINEARISATIONS = 2
"""Runs of the simulation before the last one, each about the fit to the one before; one for long records."""
ROUNDS_OF_ROBUST = 4
"""The same for a fit that few pieces cannot draw."""
LEAST_FORCE = 1e-9
"""Bounds of means [g] are not taken for less."""
MANY = 4.0
"""Rms error, over that of noise at its bound, from which second order may matter."""
SETTLED = 0.9
"""A run about the fit before was the last one needed if it leaves this part of its errors."""
MOST_ONSETS = 24
"""Times that are tried first, of an effect that sets in."""
MOST_OF_IT = 3.0
"""Factor by which the main effect must lower the errors."""
JUMP, ROUNDS_OF_JUMPS = 12.0, 6
"""Error of a window that counts as a jump, over the median error that all effects leave."""
RECORD_NOISE = "the noise of gyros and accelerometers at rest (Allan deviation), and Earth's rate"
WITH_TRUTH = "the noise of the gyros and the scatter of the true attitude at rest{earth}"
AS_STATED = "the noise of the gyros at rest{earth}, and the true attitude's error at a row, as stated: {stated} arcmin"
AND_EARTH = ", and Earth's rate"


@keeping
def carried_evidence(
    record: StrapdownRecord,
    *,
    gravity: float = STANDARD_GRAVITY,
    baseline: str | None = None,
    rates: str = "instantaneous",
    reference_bound: float | None = None,
    further: Sequence[EffectPlace] = (),
    robust: bool = False,
) -> Evidence:
    """Return the evidence of a strapdown record; where nothing can be run, the list of missing data.

    In a record with true attitude the carried attitude is compared with it over windows of several lengths; otherwise
    the direction of gravity is carried from rest to rest.

    `gravity` is the model's [m/s²]. `baseline` "calibrated" frees the gyros' bias, scale factors and misalignments;
    "nominal" is the block as delivered, its mean at rest removed. None: calibrated where gravity is the reference,
    nominal where the truth is known. `rates`, "instantaneous" or "averaged", is the meaning of a rate in the record.
    `reference_bound` is the stated largest error of the true attitude at any row [arcmin]; by default it is taken from
    the rests. `further` are effects to be tried beside those of the catalogue. `robust` linearises about a fit that few
    pieces cannot draw.

    Raises an InputError if gyros and accelerometers, or truth, cannot belong together: units, order or signs of axes.
    It also raises one for an impossible reference bound, or one without true attitude.
    """
    if baseline not in (None, *BASELINES):
        raise InputError(f"baseline '{baseline}' is not one of a strapdown record: calibrated or nominal")
    inspection = without_earth(inspect_record(record, gravity=gravity))
    if reference_bound is not None:
        check_reference_bound(reference_bound, inspection)
    check_record(inspection)
    block = baseline or ("nominal" if has_truth(inspection) else "calibrated")
    if lacks := missing_things(inspection):
        return Evidence.of(RecordReader(Linear(Rows.of(())), inspection, block, rates, warnings_of(inspection), lacks))
    run = linear_evidence(inspection, block, rates, further, robust)
    if not robust:
        run = about_main_effect(run)
    reader = judged(CarriedReader(run, inspection, block, rates, warnings_of(inspection)))
    if reference_bound is not None:
        reader = as_stated(reader, ARCMIN * reference_bound)
    options = {"gravity": gravity, "baseline": baseline, "rates": rates, "reference_bound": reference_bound}
    return Evidence.of(with_limits(reader), Source(record, carried_evidence, {**options, "further": further}))


def linear_places(effects: Iterable[Effect], motion: Motion) -> list[EffectPlace]:
    """Return the linear effects whose action the record determines."""
    places: list[EffectPlace] = []
    for effect in effects:
        has_temperature = "temperature" not in effect.needs or motion.temperature is not None
        if effect.linear and has_temperature:
            places += effect.places
    return places


def linear_evidence(
    inspection: Inspection,
    block: str,
    rates: str = "instantaneous",
    further: Sequence[EffectPlace] = (),
    robust: bool = False,
) -> Carried:
    """Return the evidence about the calibrated block of a record, against its true attitude where it has one.

    A record without true attitude has a consistent or falsified norm calibration. `block` "calibrated" makes the gyros'
    scale factors and misalignments parameters, beside their bias; "nominal" leaves them out. With true attitude the
    nominal block is taken as delivered: only the mean at rest is removed. `rates` is as for `mean_motion`; `further`
    are effects to be tried beside those of the catalogue; `robust` is as for `carried_evidence`.
    """
    motion = mean_motion(inspection.record, inspection.sampling, inspection.gravity, rates)
    x, model = np.zeros(0), GyroModel(bias=rest_mean(inspection))
    free_effects: tuple[EffectPlace, ...] = (BIAS, SCALE) if block == "calibrated" else ()
    reference = truth_reference(inspection) if has_truth(inspection) else gravity_reference(inspection)
    if isinstance(reference, Gravity):
        values = norm_values(inspection.accelerometers)
        assert values is not None
        x, free_effects = values, free_effects or (BIAS,)

    def about(x: NDArray, model: GyroModel, *, with_effects: bool) -> Carried:
        """Return the evidence about nine parameters of the accelerometers (or none) and gyros, with effects to try."""
        gyros: list[EffectPlace] = []
        forces: list[EffectPlace] = []
        if with_effects:
            gyros += [p for p in linear_places(STRAPDOWN_EFFECTS.values(), motion) if p not in free_effects]
            if len(x):
                block_effects = []
                for effect in POSITION_EFFECTS.values():
                    if effect.component == "AccelerometerBlock" and effect.untold is None:
                        block_effects.append(effect)
                forces += linear_places(block_effects, motion)
            for place in further:
                of_part = gyros if is_of_gyros(place) else forces
                of_part.append(place)
        attitude, at_rest = carried_attitude(motion, model, inspection.gravity), None
        integral = integrals(motion, model, attitude, list(free_effects) + gyros, reference.rows)
        if not free_effects:
            bias = blocks_of(gyros)[gyros.index(BIAS)]
            at_rest = means_at_rest(motion, model, gyros, inspection.rests.rows)
            # The mean already includes the bias.
            at_rest[:, bias] = 0.0
            integral = integral - integral[..., bias] @ at_rest
        run = Run(attitude, reference.rows, integral, width_of(free_effects))
        parts = reference.parts(run, x, forces)
        names = [(f"accelerometer {n}", "g" if n.startswith("bias") else "1") for n in NAMES[: len(x)]]
        point = [x]
        for place in free_effects:
            names += [(f"gyro {p.name}", p.unit) for p in place.definition.parameters]
            point.append(model.bias if place == BIAS else model.scale_misalignment)
        rows = Rows.of(parts, names, np.concatenate(point), gyros + forces)
        starting = SEARCHED if with_effects and len(motion) <= LONG else ()
        return Carried(rows, inspection, free_effects, motion, model, attitude, reference, at_rest, starting)

    rounds = RELINEARISATIONS if len(motion) <= LONG else 1
    for _ in range((ROUNDS_OF_ROBUST if robust else rounds) if free_effects else 0):
        # An hour's attitudes are large: one run's are freed before the next.
        x, model = refined(about(x, model, with_effects=False), robust)
    return about(x, model, with_effects=True)


def refined(run: Carried, robust: bool = False) -> tuple[Floats, GyroModel]:
    """Accelerometers and gyros by least squares; with scale factors and misalignments that an instrument has.

    `robust`: rows that misfit lose their weight.
    """
    step = robust_estimate(run.rows.nominal, run.rows.residual) if robust else run.rows.estimate(())
    model = with_parameters(run.gyros, run.own, step[run.of_forces :])
    # A fit with larger scale factors is wrong.
    model = replace(model, scale_misalignment=np.clip(model.scale_misalignment, -LARGEST, LARGEST))
    return (run.rows.point + step)[: run.of_forces], model


def gravity_reference(inspection: Inspection) -> Gravity:
    """Gravity as the reference of a record whose accelerometers are calibrated by their norm."""
    rests, values = inspection.rests, norm_values(inspection.accelerometers)
    assert values is not None
    reading = rests.force / inspection.gravity
    noise = gyro_noise(inspection.record, rests, inspection.sampling.period, inputs_of(values, reading))
    assert noise is not None
    deviation = np.maximum(force_deviation(inspection) / inspection.gravity, LEAST_FORCE)
    still, moves, ends = gravity_pieces(inspection)
    return Gravity(inspection.record.time_s, rests, noise, moves, ends, still, reading, deviation)


def truth_reference(inspection: Inspection) -> Truth:
    """The true attitude of a record as the reference; it is taken to err as at rest."""
    assert inspection.record.attitude is not None
    up = inspection.rests.force / inspection.gravity if len(inspection.rests) else None
    noise = gyro_noise(inspection.record, inspection.rests, inspection.sampling.period, up)
    attitude, time_s, windows = inspection.record.attitude, inspection.record.time_s, truth_windows(inspection)
    inertial, period = is_inertial(inspection.record), inspection.sampling.period
    scatter = []
    for pieces in windows:
        length = float(np.median(pieces.durations(time_s)))
        scatter.append(truth_scatter(attitude, inspection.rests, period, length, inertial=inertial))
    return Truth(time_s, inspection.rests, noise, windows, attitude, np.array(scatter), inertial=inertial)


def rest_mean(inspection: Inspection) -> Floats:
    """The gyros' mean reading over all rests (3,) [rad/s]; zeros where there are none."""
    if not len(inspection.rests):
        return np.zeros(3)
    lengths = rest_lengths(inspection.rests, 1.0)
    return lengths @ inspection.rests.rate / lengths.sum()


def about_main_effect(run: Carried) -> Carried:
    """Return the evidence about the effect that makes most of its errors; unchanged where none does.

    Signatures are of first order. Where one effect makes nearly all of large errors, its second order may exceed the
    bounds too. It then separates effects that are alike to first order: an effect that is not consistent about itself
    is not a candidate, if another one is.
    """
    runs, errors = [], []
    for place in main_effects(run):
        about = about_effect(run, place)
        runs.append((place, about))
        errors.append(_rms_left(about, (place,)))
    if not runs:
        return about_main_onset(run)
    _, best = next(pair for pair, error in zip(runs, errors, strict=True) if SETTLED * error <= min(errors))
    standing = [place for place, about in runs if about.refit([place]).radius <= about.limit]
    return best.without([place for place, _ in runs if standing and place not in standing])


def about_main_onset(run: Carried) -> Carried:
    """Return the evidence about the onset that makes most of large errors; unchanged where none does."""
    for _ in range(RELINEARISATIONS):
        before = _rms_left(run, ())
        onsets = []
        if before > MANY / np.sqrt(3.0):
            for place in run.starting:
                onsets.append(nearest_onset(run, place))
        error, place, about = min(onsets, key=lambda onset: onset[0], default=(np.inf, BIAS, run))
        if not MOST_OF_IT * error < before:
            break
        solution = about.rows.estimate([place])
        if not are_possible(place, about.values_of([place], solution)[place]):
            break
        try:
            errors = [part.error for part in about_effects(about, [place], solution).rows.parts]
        except TurnsTooFar:
            break
        run = replace(run, rows=run.rows.with_errors(errors))
    return run


def nearest_onset(run: Carried, place: EffectPlace) -> tuple[float, EffectPlace, Carried]:
    """Return the least-squares error of an effect near its best onset, with its place and the evidence there."""
    edges = run.cells[place].edges
    step = max(1, len(edges) // MOST_ONSETS)
    low, high = 0, len(edges)
    while True:
        runs, errors = [], []
        for row in edges[low:high:step]:
            about = run.with_onset(place, int(row))
            runs.append(about)
            errors.append(_rms_left(about, (place,)))
        best = int(np.argmin(errors))
        if step == 1:
            return errors[best], place, runs[best]
        middle = low + best * step
        low, high, step = max(0, middle - step), min(len(edges), middle + step + 1), max(1, step // 4)


def about_effect(run: Carried, place: EffectPlace) -> Carried:
    """Return the evidence about one of the gyros' effects, run again until its residual settles."""
    for _ in range(RELINEARISATIONS):
        before, solution = _rms_left(run, (place,)), run.rows.estimate([place])
        if not are_possible(place, run.values_of([place], solution)[place]):
            break
        try:
            run = about_effects(run, [place], solution)
        except TurnsTooFar:
            break
        if _rms_left(run, (place,)) > SETTLED * before:
            break
    return run


def main_effects(run: Carried) -> list[EffectPlace]:
    """Return the effects of the gyros that each explain most of large errors alone, about as well as any other.

    An effect that another one contains comes before it.
    """
    before = _rms_left(run, ())
    if not before > MANY / np.sqrt(3.0):
        return []
    errors = {place: _rms_left(run, (place,)) for place in run.rows.places if is_of_gyros(place)}
    least = min(errors.values(), default=np.inf)
    if not MOST_OF_IT * least < before:
        return []
    best = [place for place, error in errors.items() if SETTLED * error <= least]
    return sorted(best, key=lambda place: sum(contains([place], [contained]) for contained in best))


def _rms_left(run: Carried, places: Sequence[EffectPlace]) -> float:
    """Return the root mean square of the least-squares residual, in bounds."""
    matrix = run.rows.matrix(places)
    errors = run.rows.residual - matrix @ run.rows.estimate(places) if matrix.shape[1] else run.rows.residual
    return float(np.sqrt(np.mean(errors**2)))


def about_effects(run: Carried, places: Sequence[EffectPlace], solution: NDArray) -> Carried:
    """Return the evidence about effects of the gyros of given sizes: its errors include the second order of their run.

    The errors are those of a run with the effects, plus the first order of the effects, as if they acted linearly. A
    solution (P + k,) is a step of the model's parameters and the effects' coefficients. Gyros that lag by several rows
    have their attitude read the same number of rows later. A compensation knows only the past and extrapolates their
    rates, with an error that grows with the lag. Raises TurnsTooFar with sizes that no gyros have.
    """
    count, gyros, lag = len(run.rows.names), run.gyros_with(places, solution), 0
    if LATENCY in gyros.effects:
        (delay,) = gyros.effects[LATENCY]
        lag = round(delay / run.motion.period)
        gyros = replace(gyros, effects={**gyros.effects, LATENCY: (delay - lag * run.motion.period,)})
    attitude = carried_attitude(run.motion, gyros, run.found.gravity)
    attitude = attitude[np.clip(np.arange(len(attitude)) + lag, 0, len(attitude) - 1)]
    columns = np.concatenate([np.arange(count), count + run.rows.numbers_of(places)])
    errors = []
    for part, error in zip(run.rows.parts, run.errors_along(attitude, solution[:count]), strict=True):
        if part.pieces.kind == "norms":
            errors.append(part.error)
        else:
            slopes = np.concatenate([part.nominal, part.columns], axis=-1)
            errors.append(error + slopes[..., columns] @ solution)
    return replace(run, rows=run.rows.with_errors(errors))


def judged(reader: CarriedReader) -> CarriedReader:
    """Return the reader with the answer whether all effects together can bring the errors within the bounds.

    The bounds hold the errors of gyros and reference where no tested effect acts. The errors that the effects leave
    never widen them: such bounds would hide a fault that is not in the catalogue. With true attitude, windows are left
    out if their errors are many times those of the others and nothing in the catalogue makes them. The simulation runs
    about all effects before their first order counts as too little.
    """
    run = reader.model
    if isinstance(run.reference, Gravity):
        return replace(reader, bounds_from=RECORD_NOISE)
    reader = replace(reader, bounds_from=WITH_TRUTH.format(earth="" if is_inertial(run.found.record) else AND_EARTH))
    places = run.rows.places
    if run.refit(places).radius <= run.limit or any(run.mended([p], Work()) for p in run.starting):
        return reader
    reader = without_jumps(reader)
    run = reader.model
    least, gyros = run.refit(places).radius, [place for place in places if is_of_gyros(place)]
    for _ in range(RELINEARISATIONS):
        if least <= run.limit:
            break
        sizes = run.values_of(gyros, run.rows.estimate(gyros))
        possible = [place for place in gyros if are_possible(place, sizes[place])]
        try:
            about = about_effects(run, possible, run.rows.estimate(possible))
        except TurnsTooFar:
            break
        radius = about.refit(places).radius
        if radius >= least:
            break
        run, least = about, radius
    return replace(reader, model=run, least_radius=None if least <= run.limit else least)


def as_stated(reader: CarriedReader, stated: float) -> CarriedReader:
    """A reader of evidence that was judged, with the true attitude's error as a person states it, at any row [rad].

    It enters the bounds and nothing else: about which effects the rows are linear, and which windows are left out, is
    as without it.
    """
    run = reader.model.with_stated(stated)
    assert isinstance(run.reference, Truth)
    earth = "" if run.reference.inertial else AND_EARTH.replace(" and", "")
    basis = AS_STATED.format(earth=earth, stated=exactly(stated / ARCMIN, 12))
    least = run.refit(run.rows.places).radius
    return replace(reader, model=run, bounds_from=basis, least_radius=None if least <= run.limit else least)


def without_jumps(reader: CarriedReader) -> CarriedReader:
    """Return the reader without the windows in which gyros or true attitude jump; it reports that they are left out."""
    run = reader.model
    parts = run.rows.parts
    masks = [np.ones(len(part), dtype=bool) for part in parts]
    for _ in range(ROUNDS_OF_JUMPS):
        far = []
        for error in left_out_by_all(of_windows(run, masks)):
            size = np.linalg.norm(error, axis=1)
            far.append(size > JUMP * np.median(size))
        if not any(mask.any() for mask in far):
            break
        for mask, jumping in zip(masks, far, strict=True):
            mask[np.flatnonzero(mask)[jumping]] = False
    warnings = []
    for mask, part in zip(masks, parts, strict=True):
        if not mask.all():
            count = np.count_nonzero(~mask)
            warnings.append(
                f"{count} windows of {part.label} are not used: gyros or truth jump there as no effect does"
            )
    if not warnings:
        return reader
    return replace(reader, model=of_windows(run, masks), warnings=(*reader.warnings, *warnings))


def left_out_by_all(run: Carried) -> list[Floats]:
    """Return the errors (S, d) [rad] of each part that all effects together leave in left-out blocks."""
    even = run.rows.with_bounds([np.ones_like(part.bound) for part in run.rows.parts])
    return even.split(even.left_out(even.places, even.folds()))


def of_windows(run: Carried, masks: Sequence[NDArray]) -> Carried:
    """The windows that masks (S,) choose, of each length."""
    parts = [part.selected(mask) for part, mask in zip(run.rows.parts, masks, strict=True)]
    scored = tuple(part.pieces for part in parts)
    return replace(run, rows=run.rows.with_parts(parts), reference=replace(run.reference, scored=scored))


# Accelerometers at their limit in rests: saturation that the readings show by themselves


def with_limits(reader: CarriedReader) -> CarriedReader:
    """Return the reader with the limits of its accelerometers that the model needs.

    A reading at a limit shows only that gravity is beyond it. Such rests are left out of everything that is fitted;
    held against the model they decide whether it needs the limit.

    A limit on one side alone, unlike the catalogue's saturation, has an objection.
    """
    run, limits = reader.model, []
    if not isinstance(run.reference, Gravity):
        return reader
    for axis in range(3):
        rests = rests_at_limit(run.found, axis)
        radius = radius_with(run, rests) if rests else 0.0
        if radius <= run.limit:
            continue
        level, half, one_sided = level_of(run.found, axis)
        place, objection = EffectPlace("saturation", f"accelerometer-{axis + 1}"), ""
        if one_sided:
            objection = (
                f"accelerometer {axis + 1} is at a limit of {exactly(level)} g on one side alone; the catalogue's "
                "saturation is on both"
            )
        limits.append(ReadOff(place, (level,), ((level - half, level + half),), radius, objection))
    return replace(reader, limits=tuple(limits))


def rests_at_limit(inspection: Inspection, axis: int) -> list[slice]:
    """Rows of the rests that were left out because this accelerometer is at its limit there."""
    mask = inspection.sampling.limits.rows.get(f"f{axis + 1}")
    return [] if mask is None else [rows for rows in inspection.rests.clipped_rows if mask[rows].any()]


def level_of(inspection: Inspection, axis: int) -> tuple[float, float, bool]:
    """Return the limit of an accelerometer and half a step of its readings [g], and true if the other side has none.

    A limit counts as two-sided if the readings never reached the other side.
    """
    limits, name = inspection.sampling.limits, f"f{axis + 1}"
    values = limits.channels[name] / inspection.gravity
    levels = np.abs(values[limits.rows[name]])
    half = 0.5 * resolution_of(np.unique(values))
    beyond = max(np.abs(values).max() - levels.min(), np.ptp(levels))
    return float(levels.min()), half, bool(beyond > 2.0 * half)


def radius_with(run: Carried, rests: list[slice]) -> float:
    """Radius of the model without effects where these rests count as well, by the size of gravity."""
    reference = run.reference
    assert isinstance(reference, Gravity)
    force = run.found.record.specific_force
    reading = np.array([force[rows].mean(axis=0) for rows in rests]) / run.found.gravity
    x = run.rows.point[: len(NAMES)]
    error, slopes, by_reading = norm_equations(x, reading)
    noise: NDArray = reference.deviation.max(axis=0)
    bound = factor_for(len(rests)) * np.sqrt((by_reading**2 * noise**2).sum(axis=1))
    by_own = np.zeros((len(rests), 1, len(run.rows.names) - len(NAMES)))
    first, last = np.array([rows.start for rows in rests]), np.array([rows.stop - 1 for rows in rests])
    part = Part(
        Pieces("norms", "norms at a limit", first, last),
        error[:, None],
        bound[:, None],
        np.concatenate([-slopes[:, None, :], by_own], axis=2),
        np.zeros((len(rests), 1, width_of(run.rows.places))),
        scored=False,
    )
    return linear_fit(run.rows.with_parts((*run.rows.parts, part)), ()).radius
