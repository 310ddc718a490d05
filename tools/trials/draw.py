"""Cases drawn from a seed: an instrument, what is hidden in it, and how large that is against what must be seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace
from ...models.effects.last_stage import place_of
from ...models.effects.settling import beginnings
from ..bounded.programmes import chebyshev_radius
from ..calibration.model import Linearisation
from ..errors import InputError, nearest
from ..evidence.bench_visits import Circumstances, Visits, senses_of, signature_columns
from ..evidence.carried import Carried
from ..evidence.carried_record import linear_evidence
from ..evidence.evidence import Evidence
from ..evidence.fit import Classes, contains
from ..motion.inspect import inspect_record
from ..motion.norm import norm_values
from .bench import (
    DWELL_S,
    NOISE_BOUND,
    bench_positions,
    classes_with,
    draw_bench,
    draw_truth,
    expected,
    faultless_model,
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
from .case import NOISES, TAKEN_OUT, Case, Options, check_seed, hidden_effects
from .days import Days, draw_shared_and_own, joined
from .sizes import (
    Hidden,
    SureSizes,
    Way,
    draw_direction,
    drawn_time,
    largest_size,
    level_margins,
    sizes_of_way,
    sure_sizes,
)
from .whole import draw_whole, hidden_in

ADDING = ("reading_effects", "geometry_effects")
"""Stages of effects that are not linear but for a time that is found."""
ABOVE = 1.5
"""So many times the size that excludes every rival an effect has, where it is to be named."""
MOST_ABOVE = 30.0
"""So many times the size of sure detection is the most where nothing else limits it."""
TRIES, BLOCK_TRIES = 10, 40
"""Effects that are drawn for one bench before another one is drawn; for one moved block."""
MOST_BENCHES = 60
"""Benches that are drawn for one case."""
ALONE_SIZES = (3.0, 6.0)
"""Sizes relative to that of sure detection, of a single record of a bench."""
RATES_HZ = (50.0, 100.0, 200.0)
BASELINE = {"gravity": "calibrated", "truth": "nominal"}
"""What the diagnosis of a moved block takes for known, by the record's reference."""
UNSEEN_BETWEEN_RESTS = ("lag", "latency", "latency-step")
"""A lag turns nothing from one rest to the next."""


def draw_case(options: Options, seed: int, index: int) -> Case:
    """Draw case `index` of a suite; it does not depend on how many cases there are.

    Raises
    ------
    InputError
        no bench that was drawn can hide such effects at such sizes, or the record of the moved block cannot show them
    """
    if options.whole:
        return _draw_whole_case(options, seed, index)
    if options.records > 1:
        return _draw_days_case(options, seed, index)
    if not options.strapdown:
        return _draw_bench_case(options, seed, index)
    clean = draw_clean_block(seed, index)
    return clean if options.mode == "clean" else _hidden_in_block(clean, options)


# Records of a table's positions, in suites


def _draw_bench_case(options: Options, seed: int, index: int) -> Case:
    """Draw a bench and what is hidden in it."""
    rng = np.random.default_rng([seed, index])
    noise = NOISES[index % len(NOISES)] if options.noise == "all" else options.noise
    redrawn = 0
    for _ in range(MOST_BENCHES):
        bench = replace(draw_bench(rng, options.positions), noise=noise)
        if options.mode == "clean":
            return Case(seed, index, bench)
        here, circumstances = expected(bench)
        if here.deficient:
            redrawn += 1
            continue
        drawing = _Drawing(rng, options, here, circumstances, classes_with(bench.mountings, symmetric=bench.symmetric))
        for _ in range(TRIES if drawing.names else 0):
            hidden = drawing.pair() if options.mode == "pairs" else drawing.single()
            if hidden is not None:
                # What rounds or clips has to act on errors that are there already.
                own = all(h.place.definition.variants is None for h in hidden)
                return Case(seed, index, bench if own else replace(bench, noise="uniform"), hidden, redrawn)
            redrawn += 1
    raise InputError(
        f"--mode {options.mode}: no bench of {MOST_BENCHES} with {options.positions[0]} to {options.positions[1]} "
        "positions can hide such an effect at such a size; allow more --positions, or other --effects"
    )


def _draw_whole_case(options: Options, seed: int, index: int) -> Case:
    """Draw a whole bench and what is hidden in it."""
    rng = np.random.default_rng([seed, index])
    for redrawn in range(MOST_BENCHES):
        clean = Case(seed, index, draw_whole(rng), redrawn=redrawn)
        if options.mode == "clean":
            return clean
        hidden = hidden_in(rng, clean.instrument, clean.measured(), options, ABOVE)
        if hidden is not None:
            return replace(clean, hidden=(hidden,))
    raise InputError(f"--mode {options.mode}: no whole bench of {MOST_BENCHES} can hide such an effect at such a size")


def _draw_days_case(options: Options, seed: int, index: int) -> Case:
    """Draw a block on several days, and what is hidden in all records and in one."""
    rng, redrawn = np.random.default_rng([seed, index]), 0
    noise = NOISES[index % len(NOISES)] if options.noise == "all" else options.noise
    for _ in range(MOST_BENCHES):
        count = int(rng.integers(options.positions[0], options.positions[1] + 1))
        days = Days.drawn(rng, options.records, (count, count), noise)
        if options.mode == "clean":
            return Case(seed, index, days)
        joint = joined(days.measured(seed, index))
        for _ in range(0 if joint.missing() else TRIES):
            if (hidden := draw_shared_and_own(rng, joint, ABOVE, options.effects)) is not None:
                return Case(seed, index, days, hidden, redrawn)
            redrawn += 1
    raise InputError(
        f"--records {options.records}: no instrument of {MOST_BENCHES} can hide such effects at such sizes; allow more "
        "--positions, or other --effects"
    )


@dataclass(frozen=True)
class _Drawing:
    """What is known of a bench at best, and effects drawn for it: None where no possible size would do."""

    rng: np.random.Generator
    options: Options
    here: Linearisation
    circumstances: Circumstances
    classes: Classes

    @cached_property
    def linear(self) -> list[EffectPlace]:
        """Every linear effect that is not wholly in the nominal model, those that stand for another one too."""
        return [place for first in self.classes.places for place in self.classes.whole_class(first)]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of effects that this bench can hide."""
        seen, alone = {place.effect for place in self.linear}, self.options.mode != "pairs"
        names = [
            effect.name
            for effect in (POSITION_EFFECTS[name] for name in hidden_effects())
            if effect.name in seen or effect.name == "outlier" or (effect.variants is not None and alone)
        ]
        return tuple(name for name in names if not self.options.effects or name in self.options.effects)

    def drawn(self) -> tuple[EffectPlace, NDArray]:
        """One of the effects at one of its places, and a direction of its coefficients."""
        name = self.names[self.rng.integers(len(self.names))]
        return _draw_place(self.rng, name, self.linear, len(self.here.reading))

    def sizes(
        self, place: EffectPlace, direction: NDArray, apart: Sequence[EffectPlace], beside: Sequence[EffectPlace] = ()
    ) -> SureSizes:
        """The sizes of an effect against one rival of each class that is that of none of some effects."""
        rivals = [p for p in self.classes.places if not set(self.classes.whole_class(p)) & set(apart)] if apart else []
        ways = self.other_ways(place) if apart else []
        return sure_sizes(self.here, self.circumstances, place, rivals, direction=direction, beside=beside, ways=ways)

    @cached_property
    def ways(self) -> list[Way]:
        """Every effect that is not linear and adds to a reading, or turns the block, in each of its ways."""
        rows = Visits.of(self.here, self.circumstances).rows(self.here.point)
        known = [effect for effect in POSITION_EFFECTS.values() if effect.variants and effect.stage in ADDING]
        return [
            (place, way)
            for effect in known
            for place in effect.places
            for way in effect.variants(place, rows, rows.prediction, NOISE_BOUND)  # type: ignore[misc]
        ]

    def other_ways(self, place: EffectPlace) -> list[Way]:
        """Ways of all effects but an effect itself and those that contain it, which are no rivals."""
        return [way for way in self.ways if way[0] != place and not contains([way[0]], [place])]

    def in_way(self, place: EffectPlace) -> tuple[Hidden, ...] | None:
        """An effect that is not linear in one of its ways, at a size of the mode."""
        own, options = [way for other, way in self.ways if other == place], self.options
        way = own[self.rng.integers(len(own))]
        unit = np.eye(way.columns.shape[2])[0] * self.rng.choice([-1.0, 1.0])
        if way.sizes is not None and len(way.sizes) > 1:
            # What it was before is somewhere between the ends of what it may have been.
            unit = self.rng.dirichlet(np.ones(len(unit))) * unit.sum()
        if way.slipped is not None:
            unit = self.rng.normal(size=len(unit))
            unit /= np.linalg.norm(unit)
        sizes = sizes_of_way(
            self.here, self.circumstances, way.columns @ unit, self.classes.places, self.other_ways(place)
        )
        low, high = sizes.detected, min(sizes.excluded, MOST_ABOVE * sizes.detected)
        if options.size is not None:
            low, high = (sizes.detected * end for end in options.size)
        elif options.mode == "single":
            low = high = ABOVE * sizes.excluded
        size = low + (high - low) * float(self.rng.random())
        values = way.values(size * unit) if np.isfinite(size) else (np.inf,)
        parameters = place.definition.parameters
        if not all(parameter.possible(value) for parameter, value in zip(parameters, values, strict=False)):
            return None
        # The run begins before the record's first row.
        warmth, first = self.circumstances.temperature, float(temperature_at(np.zeros(1))[0])
        warm = None if warmth is None else (first, float(warmth[0]))
        hidden = Hidden(place, values, float(size), sizes).since(-self.circumstances.began / 3600.0, warm)
        if "settling" in hidden.parameters and warmth is not None:
            # Then, too, the lag was where it may have been.
            begun = first + hidden.parameters["settling"] / hidden.parameters["coefficient"]
            low, high = warmth[0] + beginnings(warmth)
            if not low <= begun <= high:
                return None
        return (hidden,)

    def single(self) -> tuple[Hidden, ...] | None:
        """One effect at a size of the mode."""
        place, direction = self.drawn()
        if any(other == place for other, _ in self.ways):
            return self.in_way(place)
        if place.definition.variants is not None:
            return self.level(place)
        relative = self.options.size
        sizes = self.sizes(place, direction, () if relative is not None else [place])
        if relative is not None:
            size = sizes.detected * float(np.exp(self.rng.uniform(*np.log(relative))))
        elif self.options.mode == "single":
            size = ABOVE * sizes.excluded
        else:
            top = min(sizes.excluded, MOST_ABOVE * sizes.detected, largest_size(place, direction))
            size = self.rng.uniform(sizes.detected, max(top, sizes.detected)) if np.isfinite(sizes.detected) else np.inf
        return _made(place, direction, size, sizes)

    def pair(self) -> tuple[Hidden, ...] | None:
        """Two effects, each at a size at which nothing can stand for it even when the other one is free."""
        (first, along), (second, across) = self.drawn(), self.drawn()
        if self.classes.whole_class(first)[0] == self.classes.whole_class(second)[0]:
            return None
        both: list[Hidden] = []
        for place, direction, other in ((first, along, second), (second, across, first)):
            sizes = self.sizes(place, direction, [first, second], [other])
            hidden = _made(place, direction, ABOVE * sizes.excluded, sizes)
            if hidden is None:
                return None
            both += hidden
        return tuple(both)

    def level(self, place: EffectPlace) -> tuple[Hidden, ...] | None:
        """An effect that is not linear, at a level of which the mode's sizes are true."""
        parameter, options = place.definition.parameters[0], self.options
        size = np.abs(self.here.prediction[:, place.index])
        largest = min(parameter.largest, float(size.max()))
        low = max(parameter.smallest or 0.0, 1e-3 * largest)
        levels = np.exp(self.rng.uniform(np.log(low), np.log(max(largest, low)), TRIES)).tolist()
        rivals = [p for p in self.classes.places if place not in self.classes.whole_class(p)]
        margins = level_margins(self.here, self.circumstances, place, levels, rivals)
        for level, sizes in zip(levels, margins, strict=True):
            wanted = ABOVE * sizes.excluded <= 1.0
            if options.mode == "between":
                wanted = sizes.detected <= 1.0 < sizes.excluded
            if options.size is not None:
                wanted = options.size[0] <= 1.0 / sizes.detected <= options.size[1]
            if wanted:
                return (Hidden(place, (level,), 1.0, sizes),)
        return None


def _draw_place(
    rng: np.random.Generator, name: str, places: Sequence[EffectPlace], positions: int
) -> tuple[EffectPlace, NDArray]:
    """One of an effect's places, or any reading for an outlier, and a direction of its coefficients."""
    if name == "outlier":
        place = place_of(int(rng.integers(positions)) + 1, int(rng.integers(3)) + 1)
    else:
        own = [place for place in places if place.effect == name] or list(CATALOGUE[name].places)
        place = own[rng.integers(len(own))]
    return place, draw_direction(rng, place)


def _made(place: EffectPlace, direction: NDArray, size: float, sizes: SureSizes) -> tuple[Hidden] | None:
    """The effect at a size; None where that is not a possible one."""
    if not np.isfinite(size) or size > largest_size(place, direction):
        return None
    values = place.definition.from_coefficients(size * direction)
    return (Hidden(place, values, float(size), sizes),)


# A single record of a table's positions


def draw_alone(seed: int, *, effects: Sequence[str] | None = None, symmetric: bool = False) -> Case:
    """Draw truth, effect and size of a record by itself.

    Parameters
    ----------
    seed : int
        from 0 to 2**31 - 1; the same seed gives the same case
    effects : sequence of str, optional
        names to draw from; an empty one gives a clean record; by default every effect that the baseline lacks
    symmetric : bool
        the block's scale factors do not depend on the sign

    Raises
    ------
    InputError
        an unknown name, or a seed out of range
    """
    check_seed(seed)
    rng = np.random.default_rng(seed)
    truth = draw_truth(rng, symmetric=symmetric)
    alpha, beta = bench_positions()
    order = rng.permutation(len(alpha))
    alpha, beta = alpha[order], beta[order]
    bench = plain_bench(truth, alpha, beta, symmetric=symmetric)
    here = faultless_model({"identity": np.eye(3)}, alpha, beta, symmetric=symmetric)
    hours = np.arange(len(alpha)) * (DWELL_S + 4.0) / 3600.0
    # About as the bench will run.
    circumstances = Circumstances(hours, temperature_at(hours), senses_of(alpha), senses_of(beta), True)
    rows = Visits.of(here, circumstances).rows(here.point)
    basis, _ = np.linalg.qr(here.jacobian)
    visible = []
    for effect in POSITION_EFFECTS.values():
        for place in effect.places if effect.within != bench.baseline and effect.variants is None else ():
            columns = signature_columns([place], rows)
            if np.linalg.norm(columns - basis @ (basis.T @ columns)) > 1e-9:
                visible.append(place)
    seen = {place.effect for place in visible}
    usable = [name for name in POSITION_EFFECTS if name == "outlier" or name in seen]
    for name in effects or ():
        if name not in usable:
            raise InputError(f"--effect {name}: not one that can be hidden here; {nearest(name, usable)}")
    names = usable if effects is None else list(effects)
    if not names:
        return Case(seed, None, bench)
    place, direction = _draw_place(rng, names[rng.integers(len(names))], visible, len(alpha))
    unit = signature_columns([place], rows) @ direction
    size = rng.uniform(*ALONE_SIZES) * _sure_size(here.jacobian, unit, NOISE_BOUND)
    effect = place.definition
    values = effect.from_coefficients(min(size, effect.parameters[0].largest) * direction)
    return Case(seed, None, bench, (Hidden(place, values),))


def _sure_size(nominal: NDArray, unit: NDArray, bound: float) -> float:
    """Size of an effect from which it is surely detected: twice the bound over the distance of its unit.

    That distance, in the maximum norm, is from all that the nominal model can say; nominal (M, P), unit (M,).
    """
    radius, _, _ = chebyshev_radius(nominal, unit, np.ones(len(unit)))
    return 2.0 * bound / radius if radius > 1e-9 else math.inf


# Records of a block moved by hand


def draw_clean_block(seed: int, index: int, reference: Reference | None = None) -> Case:
    """A case with nothing hidden; by default every second one has the true attitude.

    Before a camera the gyros are delivered with scale factors that are right.
    """
    chosen: Reference = reference or ("truth" if index % 2 else "gravity")
    rng = np.random.default_rng([seed, index])
    period = 1.0 / rng.choice(RATES_HZ)
    motion = draw_motion(rng, BEFORE_A_CAMERA if chosen == "truth" else BETWEEN_RESTS, period)
    instruments = draw_instruments(rng, delivered=chosen == "truth")
    temperature = None
    if rng.random() < 0.5:
        hours = period * np.arange(len(motion)) / 3600.0
        temperature = np.round(rng.uniform(15.0, 30.0) + rng.uniform(1.0, 8.0) * (1.0 - np.exp(-hours / 0.05)), 2)
    return Case(seed, index, Block(chosen, motion, instruments, temperature))


def _hidden_in_block(clean: Case, options: Options) -> Case:
    """The case with an effect of a size relative to that of sure detection."""
    block, index, evidence = clean.instrument, clean.index, evidence_of(clean)
    rng = np.random.default_rng([clean.seed, index or 0, 1])
    if evidence is None:
        raise InputError(f"case {index}: its rests do not tell the accelerometers' parameters")
    unseen = (*TAKEN_OUT, *(UNSEEN_BETWEEN_RESTS if block.reference == "gravity" else ()))
    every = (*evidence.places, *evidence.starting)
    shown = {place.effect for place in every if not options.effects or place.effect in options.effects}
    names = sorted(shown - set(unseen))
    for redrawn in range(BLOCK_TRIES if names else 0):
        name = names[rng.integers(len(names))]
        places = [place for place in every if place.effect == name]
        place = places[rng.integers(len(places))]
        here = evidence
        if place in evidence.starting:
            here = evidence.with_onset(place, drawn_time(rng, evidence, place))
        wanted = float(rng.uniform(*options.sizes))
        effect = place.definition
        if effect.component == "AttitudeComputer" and not block.instruments.increments:
            continue
        if place.effect == STAMPS:
            jitter = _jitter_of(clean, place, wanted)
            if jitter is not None:
                hidden = (Hidden(place, (1.0,), wanted),)
                return Case(clean.seed, index, replace(block, jitter=jitter), hidden, redrawn)
            continue
        direction = draw_direction(rng, place)
        coefficients = wanted * size_in_block(here, place, direction) * direction
        values = here.values_of([place], np.append(np.zeros(len(here.names)), coefficients))[place]
        if all(np.isfinite(v) and p.possible(v) for v, p in zip(values, effect.parameters, strict=True)):
            return replace(clean, hidden=(Hidden(place, values, wanted),), redrawn=redrawn)
    raise InputError(f"case {index}: a record with {block.reference} for its reference cannot show such an effect")


def evidence_of(case: Case) -> Carried | None:
    """The evidence that a diagnosis makes of the record of a moved block; None where it can make none."""
    found, reference = inspect_record(case.measured(), gravity=STANDARD_GRAVITY), case.instrument.reference
    if reference == "gravity" and norm_values(found.accelerometers) is None:
        return None
    return linear_evidence(found, BASELINE[reference])


def size_in_block(evidence: Evidence, place: EffectPlace, direction: NDArray) -> float:
    """The size, along a direction of the coefficients, from which the record surely disproves the model.

    Beside what the effect contains: where that does as well, it is what is named.
    """
    contained = [p for p in evidence.places if p.effect in place.definition.contains and p.where == place.where]
    return _sure_size(evidence.matrix(contained), evidence.columns_of([place]) @ direction, 1.0)


def _jitter_of(clean: Case, place: EffectPlace, wanted: float) -> float | None:
    """How far time stamps must jitter, while the sampling does not, for the size; None where that is too far."""
    furthest = replace(
        clean, instrument=replace(clean.instrument, jitter=FURTHEST_STAMP), hidden=(Hidden(place, (1.0,)),)
    )
    evidence = evidence_of(furthest)
    if evidence is None or place not in evidence.places:
        return None
    part = wanted * size_in_block(evidence, place, np.ones(1))
    return part * FURTHEST_STAMP if part <= 1.0 else None
