"""Draw cases from a seed: an instrument, its hidden effects, and their sizes relative to those of sure detection."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import POSITION_EFFECTS, EffectPlace
from ...models.effects.mounting import MOUNTING
from ..bounded.programmes import chebyshev_radius
from ..errors import InputError, nearest
from ..evidence.bench import bench_evidence
from ..evidence.bench_visits import Circumstances, senses_of, signature_columns
from ..evidence.carried_record import linear_evidence
from ..evidence.carried_run import Carried
from ..evidence.joint import join
from ..evidence.rows import Rows
from ..motion.inspect import inspect_record
from ..motion.norm import norm_values
from .bench import (
    DWELL_S,
    NOISE_BOUND,
    bench_positions,
    draw_bench,
    draw_days,
    draw_truth,
    draw_whole,
    plain_bench,
    temperature_at,
)
from .block import (
    BEFORE_A_CAMERA,
    BETWEEN_RESTS,
    FURTHEST_STAMP,
    STAMPS,
    Block,
    Reference,
    draw_instruments,
    draw_motion,
)
from .case import NOISES, TAKEN_OUT, WITH_FAULT, Case, Options, check_seed
from .faults import draw_fault
from .hiding import (
    TRIES,
    Drawing,
    draw_place,
    draw_shared_and_own,
    expected,
    faultless_model,
    faultless_record,
    hidden_in,
)
from .sizes import Hidden, KnownBench, draw_direction, drawn_time

BLOCK_TRIES = 40
"""Number of effects that are drawn for one moved block."""
MOST_BENCHES = 60
"""Number of benches that are drawn for one case."""
ALONE_SIZES = (3.0, 6.0)
"""Range of sizes relative to that of sure detection, of a single record of a bench."""
RATES_HZ = (50.0, 100.0, 200.0)
BASELINE = {"gravity": "calibrated", "truth": "nominal"}
"""Baseline of a moved block's diagnosis, by the record's reference."""
UNSEEN_BETWEEN_RESTS = ("lag", "latency", "latency-step")
"""Effects that rests do not show: a lag turns nothing from one rest to the next."""


def draw_case(options: Options, seed: int, index: int) -> Case:
    """Draw case `index` of a suite; it does not depend on the number of cases.

    Raises
    ------
    InputError
        if no drawn bench can hide such effects at such sizes, or if the record of the moved block cannot show them
    """
    if options.strapdown and not options.whole and options.records == 1:
        clean = draw_clean_block(seed, index)
        if options.mode == "clean":
            return clean
        return _hidden_in_block(clean, options)
    rng, redrawn = np.random.default_rng([seed, index]), 0
    if options.noise == "all":
        noise = NOISES[index % len(NOISES)]
    else:
        noise = options.noise
    for _ in range(MOST_BENCHES):
        clean = _clean_bench(rng, options, noise, Case(seed, index, None))
        if options.mode == "clean":
            return replace(clean, redrawn=redrawn)
        if options.mode in WITH_FAULT:
            clean = _with_fault(rng, clean)
            if clean.fault is None:
                redrawn += 1
                continue
            if options.mode == "faults":
                return replace(clean, redrawn=redrawn)
        for hidden in _tried(rng, options, clean):
            if hidden is not None:
                return replace(_as_it_can_be_read(clean, hidden), hidden=hidden, redrawn=redrawn)
            redrawn += 1
    if options.whole:
        of, change = f"--mode {options.mode}: no whole bench of {MOST_BENCHES} can hide such an effect", ""
    elif options.records > 1:
        of = f"--records {options.records}: no instrument of {MOST_BENCHES} can hide such effects"
        raise InputError(f"{of} at such sizes; allow more --positions, or other --effects")
    else:
        few, many = options.positions
        of = f"--mode {options.mode}: no bench of {MOST_BENCHES} with {few} to {many} positions can hide such an effect"
        change = "; allow more --positions, or other --effects"
    raise InputError(f"{of} at such a size{change}")


def _with_fault(rng: np.random.Generator, clean: Case) -> Case:
    """Return a clean case with a wrong row or a break; without one if its bench allows none."""
    known = expected(clean.instrument)
    if known.model.deficient:
        return clean
    return replace(clean, fault=draw_fault(rng, known, clean.instrument, faultless_record(clean.instrument)))


def _clean_bench(rng: np.random.Generator, options: Options, noise: str, case: Case) -> Case:
    """Return a case with the seed and index of `case`, with a bench, a whole bench, or one block's benches of
    several days."""
    if options.whole:
        return replace(case, instrument=draw_whole(rng))
    if options.records > 1:
        count = int(rng.integers(options.positions[0], options.positions[1] + 1))
        days = draw_days(rng, options.records, (count, count), noise)
        return replace(case, instrument=days[0], days=tuple(days))
    return replace(case, instrument=replace(draw_bench(rng, options.positions), noise=noise))


def _tried(rng: np.random.Generator, options: Options, clean: Case) -> Iterator[tuple[Hidden, ...] | None]:
    """Yield hidden effects drawn for a clean case, again and again; None for an impossible draw."""
    if options.whole:
        hidden = hidden_in(rng, clean.instrument, clean.measured(), options)
        yield None if hidden is None else (hidden,)
    elif options.records > 1:
        records = clean.measured()
        evidence_by_label = {}
        for name, record in records.items():
            evidence_by_label[name] = bench_evidence(record, noise_bound=NOISE_BOUND)
        joint = join(evidence_by_label)
        for _ in range(0 if joint.reader.missing() else TRIES):
            yield draw_shared_and_own(rng, joint.model, options.effects)
    else:
        of_effects = replace(options, mode="single") if options.mode in WITH_FAULT else options
        drawing = Drawing.of(rng, of_effects, clean.instrument)
        if drawing.known.model.deficient:
            yield None
            return
        for _ in range(TRIES if drawing.names else 0):
            if options.mode == "pairs":
                drawn = drawing.pair()
            else:
                drawn = drawing.single()
            yield drawn


def _as_it_can_be_read(clean: Case, hidden: Sequence[Hidden]) -> Case:
    """Return the case with uniform noise if something rounds or clips: it must act on existing errors."""
    if clean.days or all(effect.place.definition.linear for effect in hidden):
        return clean
    return replace(clean, instrument=replace(clean.instrument, noise="uniform"))


def draw_alone(seed: int, *, effects: Sequence[str] | None = None, symmetric: bool = False) -> Case:
    """Draw truth, effect and size of a single record.

    Parameters
    ----------
    seed : int
        from 0 to 2**31 - 1; the same seed gives the same case
    effects : sequence of str, optional
        names to draw from; an empty sequence gives a clean record; by default every effect of accelerometers and table
        that the baseline lacks
    symmetric : bool
        True if the block's scale factors do not depend on the sign

    Returns
    -------
    Case
        the single record to make

    Raises
    ------
    InputError
        for an unknown name, or a seed out of range
    """
    check_seed(seed)
    rng = np.random.default_rng(seed)
    truth = draw_truth(rng, symmetric=symmetric)
    alpha, beta = bench_positions()
    order = rng.permutation(len(alpha))
    alpha, beta = alpha[order], beta[order]
    bench = plain_bench(truth, alpha, beta, symmetric=symmetric)
    model = faultless_model({"identity": np.eye(3)}, alpha, beta, symmetric=symmetric)
    hours = np.arange(len(alpha)) * (DWELL_S + 4.0) / 3600.0
    # Approximately the way of the bench.
    circumstances = Circumstances(hours, temperature_at(hours), senses_of(alpha), senses_of(beta), True)
    rows = KnownBench(model, circumstances).rows
    basis, _ = np.linalg.qr(model.jacobian)
    visible: list[EffectPlace] = []
    usable: list[str] = []
    for effect in POSITION_EFFECTS.values():
        count_before = len(visible)
        for place in effect.places if effect.within != bench.baseline and effect.linear else ():
            columns = signature_columns([place], rows)
            if np.linalg.norm(columns - basis @ (basis.T @ columns)) > 1e-9:
                visible.append(place)
        if effect.name == "outlier" or len(visible) > count_before:
            usable.append(effect.name)
    for name in effects or ():
        if name not in usable:
            raise InputError(f"--effect {name}: not one that can be hidden here; {nearest(name, usable)}")
    names = [name for name in usable if name == "outlier" or POSITION_EFFECTS[name].places[0].where != MOUNTING]
    if effects is not None:
        names = list(effects)
    if not names:
        return Case(seed, None, bench)
    place, direction = draw_place(rng, names[rng.integers(len(names))], visible, len(alpha))
    unit = signature_columns([place], rows) @ direction
    size = rng.uniform(*ALONE_SIZES) * _sure_size(model.jacobian, unit, NOISE_BOUND)
    effect = place.definition
    values = effect.from_coefficients(min(size, effect.parameters[0].largest) * direction)
    return Case(seed, None, bench, (Hidden(place, values),))


def _sure_size(nominal: NDArray, unit: NDArray, bound: float) -> float:
    """Return the size of sure detection of an effect: twice the bound over the distance of its unit.

    The distance, in the maximum norm, is from the range of the nominal model; nominal (M, P), unit (M,).
    """
    radius, _, _ = chebyshev_radius(nominal, unit, np.ones(len(unit)))
    if radius > 1e-9:
        return 2.0 * bound / radius
    return math.inf


# Records of a block moved by hand


def draw_clean_block(seed: int, index: int, reference: Reference | None = None) -> Case:
    """Draw a case without hidden effects; by default every second one has the true attitude.

    With a true attitude the gyros have correct scale factors.
    """
    chosen: Reference = reference or ("truth" if index % 2 else "gravity")
    rng = np.random.default_rng([seed, index])
    period = 1.0 / rng.choice(RATES_HZ)
    if chosen == "truth":
        schedule = BEFORE_A_CAMERA
    else:
        schedule = BETWEEN_RESTS
    motion = draw_motion(rng, schedule, period)
    instruments = draw_instruments(rng, delivered=chosen == "truth")
    temperature = None
    if rng.random() < 0.5:
        hours = period * np.arange(len(motion)) / 3600.0
        temperature = np.round(rng.uniform(15.0, 30.0) + rng.uniform(1.0, 8.0) * (1.0 - np.exp(-hours / 0.05)), 2)
    return Case(seed, index, Block(chosen, motion, instruments, temperature))


def _hidden_in_block(clean: Case, options: Options) -> Case:
    """Return the case with an effect of a size relative to that of sure detection."""
    block, index, model = clean.instrument, clean.index, block_model(clean)
    rng = np.random.default_rng([clean.seed, index or 0, 1])
    if model is None:
        raise InputError(f"case {index}: its rests do not tell the accelerometers' parameters")
    unseen: set[str] = set(TAKEN_OUT)
    if block.reference == "gravity":
        unseen.update(UNSEEN_BETWEEN_RESTS)
    every = (*model.rows.places, *model.starting)
    possible = {place.effect for place in every if not options.effects or place.effect in options.effects}
    names = sorted(possible - unseen)
    for redrawn in range(BLOCK_TRIES if names else 0):
        name = names[rng.integers(len(names))]
        places = [place for place in every if place.effect == name]
        place = places[rng.integers(len(places))]
        at_time = model
        if place in model.starting:
            at_time = model.with_onset(place, drawn_time(rng, model, place))
        relative = float(rng.uniform(*options.sizes))
        effect = place.definition
        if effect.component == "AttitudeComputer" and not block.instruments.increments:
            continue
        if place.effect == STAMPS:
            jitter = _jitter_of(clean, place, relative)
            if jitter is not None:
                hidden = (Hidden(place, (1.0,), relative),)
                return Case(clean.seed, index, replace(block, jitter=jitter), hidden, redrawn)
            continue
        direction = draw_direction(rng, place)
        coefficients = relative * size_in_block(at_time.rows, place, direction) * direction
        values = at_time.values_of([place], np.append(np.zeros(len(at_time.rows.names)), coefficients))[place]
        if all(np.isfinite(v) and p.possible(v) for v, p in zip(values, effect.parameters, strict=True)):
            return replace(clean, hidden=(Hidden(place, values, relative),), redrawn=redrawn)
    raise InputError(f"case {index}: a record with {block.reference} for its reference cannot show such an effect")


def block_model(case: Case) -> Carried | None:
    """Return the nominal model for the diagnosis of a moved block's record; None if the record allows none."""
    inspection, reference = inspect_record(case.measured(), gravity=STANDARD_GRAVITY), case.instrument.reference
    if reference == "gravity" and norm_values(inspection.accelerometers) is None:
        return None
    return linear_evidence(inspection, BASELINE[reference])


def size_in_block(rows: Rows, place: EffectPlace, direction: NDArray) -> float:
    """Return the size, along a direction of the coefficients, from which the record surely disproves the model.

    The model includes the effects that this effect contains: the diagnosis would name one of them if it does as well.
    """
    contained = []
    for p in rows.places:
        if p.effect in place.definition.contains and p.where == place.where:
            contained.append(p)
    return _sure_size(rows.matrix(contained), rows.columns_of([place]) @ direction, 1.0)


def _jitter_of(clean: Case, place: EffectPlace, wanted: float) -> float | None:
    """Return the jitter of time stamps for the size, with regular sampling [periods]; None if it is too large."""
    furthest = replace(
        clean, instrument=replace(clean.instrument, jitter=FURTHEST_STAMP), hidden=(Hidden(place, (1.0,)),)
    )
    model = block_model(furthest)
    if model is None or place not in model.rows.places:
        return None
    part = wanted * size_in_block(model.rows, place, np.ones(1))
    if part <= 1.0:
        return part * FURTHEST_STAMP
    return None
