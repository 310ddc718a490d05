"""The model of a bench at its true parameters, and the hidden effect, its place and its size."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, POSITION_EFFECTS, Effect, EffectPlace
from ...models.effects.last_stage import place_of
from ..calibration.calibration import Asked, fit_record
from ..calibration.model import PRESETS, Positions, linearise, parametrise
from ..evidence.bench_in_motion import whole_evidence
from ..evidence.bench_predictions import dense_spaces
from ..evidence.bench_visits import circumstances_of
from ..evidence.cells import CellsAtRest, beginnings
from ..evidence.fit import Classes, contains
from ..evidence.joint import Joint
from ..evidence.observation import acts_at_rest
from ..evidence.of_record import InRecord, plain
from ..records import PositionRecord
from .bench import (
    ACCELERATION,
    DWELL_S,
    NOISE_BOUND,
    RATE,
    START_APART,
    STEP_S,
    TrialBench,
    temperature_at,
)
from .case import Options, hidden_effects
from .faults import readings_of
from .sizes import (
    Hidden,
    KnownBench,
    SureSizes,
    Way,
    draw_direction,
    drawn_time,
    largest_possible_size,
    most_alike,
    sizes_of_change,
)

ABOVE = 1.5
"""Size of an effect that a diagnosis must name, relative to the size that excludes every rival."""
MOST_ABOVE = 30.0
"""Default largest size, relative to that of sure detection."""
TRIES = 10
"""Number of effects drawn for one bench before the next bench, and of levels drawn for one effect."""


def faultless_record(bench: TrialBench) -> PositionRecord:
    """Return the bench's record without secret and noise, in approximately the circumstances of its run."""
    reading = readings_of(bench)
    ways = np.stack([np.diff(angle, prepend=angle[0] - START_APART) for angle in (bench.alpha, bench.beta)], axis=1)
    size = np.abs(ways)
    long = RATE**2 / ACCELERATION
    move = np.where(size > long, size / RATE + RATE / ACCELERATION, 2.0 * np.sqrt(size / ACCELERATION)).max(axis=1)
    # A move ends with a step of the run; a row has the time of the middle of its rest.
    time = np.cumsum(np.ceil(move / STEP_S - 1e-6) * STEP_S + DWELL_S) - 0.5 * DWELL_S
    senses = np.sign(ways)
    for row in range(1, len(senses)):
        senses[row] = np.where(senses[row] == 0.0, senses[row - 1], senses[row])
    names = None
    if len(bench.mountings) > 1:
        names = tuple(bench.mountings[k] for k in bench.mounting)
    return PositionRecord(
        position=np.arange(1, len(reading) + 1),
        time_s=time,
        alpha=bench.alpha,
        beta=bench.beta,
        specific_force=STANDARD_GRAVITY * reading,
        temperature=temperature_at(time / 3600.0),
        approach_alpha=senses[:, 0],
        approach_beta=senses[:, 1],
        mounting=names,
    )


def expected(bench: TrialBench) -> KnownBench:
    """Return the model at the truth, and the circumstances of the rows."""
    record = faultless_record(bench)
    model = fit_record(record, NOISE_BOUND, Asked(baseline=bench.baseline, mounting=bench.matrices))
    return KnownBench(model, circumstances_of(record))


def faultless_model(mountings: Mapping[str, NDArray], alpha: NDArray, beta: NDArray, *, symmetric: bool):
    """Return the model linearised at a faultless bench, at positions in the first mounting.

    Returns
    -------
    Linearisation
        the linear model
    """
    p = parametrise(mountings, symmetric=symmetric)
    count = len(alpha)
    at = Positions(alpha, beta, np.zeros(count, dtype=int))
    return linearise(p, at, np.zeros((count, 3)), np.zeros(len(p.symbols)), np.full(3 * count, NOISE_BOUND))


def classes_with(mountings: tuple[str, ...], *, symmetric: bool) -> Classes:
    """Return the linear effects, sorted into classes that these mountings can tell apart."""
    return _classes_with(mountings, tuple(POSITION_EFFECTS.values()), symmetric)


@lru_cache(maxsize=64)
def _classes_with(mountings: tuple[str, ...], effects: tuple[Effect, ...], symmetric: bool) -> Classes:
    p = parametrise({name: PRESETS[name] for name in mountings}, symmetric=symmetric)
    baseline = "asymmetric"
    if symmetric:
        baseline = "symmetric"
    places: list[EffectPlace] = []
    for effect in effects:
        if effect.within != baseline and effect.linear:
            places += effect.places
    return Classes.of(places, dense_spaces(p, places))


def places_of_classes(classes: Classes) -> list[EffectPlace]:
    """Return every place of the classes, including represented ones."""
    places: list[EffectPlace] = []
    for first in classes.places:
        places += classes.whole_class(first)
    return places


@dataclass(frozen=True)
class Drawing:
    """The model of a bench at its truth, and effects drawn for it: None if no possible size fits."""

    rng: np.random.Generator
    options: Options
    known: KnownBench
    classes: Classes

    @staticmethod
    def of(rng: np.random.Generator, options: Options, bench: TrialBench) -> "Drawing":
        """Return the drawing of effects for a bench."""
        return Drawing(rng, options, expected(bench), classes_with(bench.mountings, symmetric=bench.symmetric))

    @cached_property
    def linear(self) -> list[EffectPlace]:
        """Every linear effect that is not wholly in the nominal model, including represented ones."""
        return places_of_classes(self.classes)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of effects that this bench can hide."""
        hideable = {"outlier"}
        for place in self.linear:
            hideable.add(place.effect)
        if self.options.mode != "pairs":
            hideable |= {name for name in hidden_effects() if not POSITION_EFFECTS[name].linear}
        if self.options.effects:
            hideable &= set(self.options.effects)
        return tuple(name for name in hidden_effects() if name in hideable)

    def drawn(self) -> tuple[EffectPlace, NDArray]:
        """Draw one of the effects at one of its places, and a direction of its coefficients."""
        name = self.names[self.rng.integers(len(self.names))]
        return draw_place(self.rng, name, self.linear, len(self.known.model.reading))

    def sizes(
        self, place: EffectPlace, direction: NDArray, apart: Sequence[EffectPlace], beside: Sequence[EffectPlace] = ()
    ) -> SureSizes:
        """Return the sizes of an effect against one rival of each class, without the classes of the effects in
        `apart`."""
        rivals, ways = [], []
        if apart:
            for rival in self.classes.places:
                if not set(self.classes.whole_class(rival)) & set(apart):
                    rivals.append(rival)
            ways = self.other_ways(place)
        return self.known.sure_sizes(place, rivals, direction=direction, beside=beside, ways=ways)

    @cached_property
    def ways(self) -> list[Way]:
        """Return every effect with an unknown number, in each cell of it."""
        ways: list[Way] = []
        for effect in POSITION_EFFECTS.values():
            for place in effect.places if effect.searched is not None else ():
                for cell in CellsAtRest(place, self.known.rows):
                    ways.append((place, cell))
        return ways

    def other_ways(self, place: EffectPlace) -> list[Way]:
        """Return the ways of all rivals: neither the effect itself nor effects that contain it."""
        return [way for way in self.ways if way[0] != place and not contains([way[0]], [place])]

    def in_way(self, place: EffectPlace) -> tuple[Hidden, ...] | None:
        """Return an effect that is not linear in one of its ways, at a size of the mode."""
        ways, options = [way for nonlinear, way in self.ways if nonlinear == place], self.options
        way = ways[self.rng.integers(len(ways))]
        unit = np.eye(way.columns.shape[2])[0] * self.rng.choice([-1.0, 1.0])
        if way.one_sign and len(way.directions) > 1:
            # Its previous value is anywhere within its possible range.
            unit = self.rng.dirichlet(np.ones(len(unit))) * unit.sum()
        if place.definition.stage == "geometry_effects":
            unit = self.rng.normal(size=len(unit))
            unit /= np.linalg.norm(unit)
        change, rivals = way.columns @ unit, self.classes.places
        sizes = self.known.sizes_of_way(change, rivals, self.other_ways(place))
        low, high = sizes.detected, min(sizes.excluded, MOST_ABOVE * sizes.detected)
        if options.size is not None:
            low, high = (sizes.detected * end for end in options.size)
        elif options.mode == "single":
            low = high = ABOVE * sizes.excluded
        size = low + (high - low) * float(self.rng.random())
        if not np.isfinite(size):
            return None
        values = way.values(size * unit)
        parameters = place.definition.parameters
        if not all(parameter.possible(value) for parameter, value in zip(parameters, values, strict=False)):
            return None
        # The run begins before the record's first row.
        warmth, first = self.known.circumstances.temperature, float(temperature_at(np.zeros(1))[0])
        warm = None
        if warmth is not None:
            warm = (first, float(warmth[0]))
        hidden = Hidden(place, values, float(size), sizes).since(-self.known.circumstances.began / 3600.0, warm)
        if "settling" in hidden.parameters and warmth is not None:
            # At that time, too, the lag had one of its possible values.
            begun = first + hidden.parameters["settling"] / hidden.parameters["coefficient"]
            low, high = warmth[0] + beginnings(warmth)
            if not low <= begun <= high:
                return None
        return (hidden,)

    def single(self) -> tuple[Hidden, ...] | None:
        """Return one effect at a size of the mode."""
        place, direction = self.drawn()
        if any(nonlinear == place for nonlinear, _ in self.ways):
            return self.in_way(place)
        if place.definition.variants is not None:
            return self.level(place)
        relative = self.options.size
        sizes = self.sizes(place, direction, () if relative is not None else [place])
        size = ABOVE * sizes.excluded
        if relative is not None:
            size = relative_size(self.rng, sizes, relative)
        elif self.options.mode == "between":
            top = min(sizes.excluded, MOST_ABOVE * sizes.detected, largest_possible_size(place, direction))
            size = np.inf
            if np.isfinite(sizes.detected):
                size = self.rng.uniform(sizes.detected, max(top, sizes.detected))
        hidden = hidden_at(place, direction, size, sizes)
        if hidden is None:
            return None
        return (hidden,)

    def pair(self) -> tuple[Hidden, ...] | None:
        """Return two effects, each at a size at which no rival can replace it even when the other one is free."""
        (first, along), (second, across) = self.drawn(), self.drawn()
        if self.classes.whole_class(first)[0] == self.classes.whole_class(second)[0]:
            return None
        pair: list[Hidden] = []
        for place, direction, companion in ((first, along, second), (second, across, first)):
            sizes = self.sizes(place, direction, [first, second], [companion])
            hidden = hidden_at(place, direction, ABOVE * sizes.excluded, sizes)
            if hidden is None:
                return None
            pair.append(hidden)
        return tuple(pair)

    def level(self, place: EffectPlace) -> tuple[Hidden, ...] | None:
        """Return an effect that is not linear, at a level at which the mode's sizes hold."""
        parameter, options = place.definition.parameters[0], self.options
        largest = min(parameter.largest, float(np.abs(self.known.model.prediction[:, place.index]).max()))
        low = max(parameter.smallest or 0.0, 1e-3 * largest)
        levels = np.exp(self.rng.uniform(np.log(low), np.log(max(largest, low)), TRIES)).tolist()
        rivals = []
        for rival in self.classes.places:
            if place not in self.classes.whole_class(rival):
                rivals.append(rival)
        margins = self.known.level_margins(place, levels, rivals)
        for level, sizes in zip(levels, margins, strict=True):
            fits = ABOVE * sizes.excluded <= 1.0
            if options.mode == "between":
                fits = sizes.detected <= 1.0 < sizes.excluded
            if options.size is not None:
                fits = options.size[0] <= 1.0 / sizes.detected <= options.size[1]
            if fits:
                return (Hidden(place, (level,), 1.0, sizes),)
        return None


def draw_place(
    rng: np.random.Generator, name: str, places: Sequence[EffectPlace], positions: int
) -> tuple[EffectPlace, NDArray]:
    """Return one of an effect's places, or any reading for an outlier, and a direction of its coefficients."""
    if name == "outlier":
        place = place_of(int(rng.integers(positions)) + 1, int(rng.integers(3)) + 1)
    else:
        possible = [place for place in places if place.effect == name] or list(CATALOGUE[name].places)
        place = possible[rng.integers(len(possible))]
    return place, draw_direction(rng, place)


def relative_size(rng: np.random.Generator, sizes: SureSizes, relative: tuple[float, float]) -> float:
    """Draw a size between two that are relative to that of sure detection, uniform in its logarithm."""
    return sizes.detected * float(np.exp(rng.uniform(*np.log(relative))))


def hidden_at(place: EffectPlace, direction: NDArray, size: float, sizes: SureSizes) -> Hidden | None:
    """Return the effect at a size along a direction of its coefficients; None if that is impossible."""
    if not np.isfinite(size) or size > largest_possible_size(plain(place), direction):
        return None
    return Hidden(place, place.definition.from_coefficients(size * direction), float(size), sizes)


def draw_shared_and_own(
    rng: np.random.Generator, joint: Joint, names: Sequence[str] = ()
) -> tuple[Hidden, Hidden] | None:
    """Draw an effect of all records and one of a single record, of these names if any; the records of `joint` are
    clean.

    Each has `ABOVE` times the size that excludes every other effect beside the two. Returns None if that is impossible.
    """
    places = []
    for place in joint.classes.places:
        if not names or place.effect in names:
            places.append(place)
    label = joint.labels[rng.integers(len(joint.labels))]
    common = []
    for place in places:
        if not isinstance(place, InRecord):
            common.append(place)
    alone = []
    for place in places:
        if type(place) is InRecord and place.record == label:
            alone.append(place)
    if not common or not alone:
        return None
    first, second = common[rng.integers(len(common))], alone[rng.integers(len(alone))]
    if (first.where, first.effect) == (second.where, second.effect):
        return None
    shared, single = _beside(rng, joint, first, second), _beside(rng, joint, second, first)
    if shared is None or single is None:
        return None
    return (shared, single)


def _beside(rng: np.random.Generator, joint: Joint, place: EffectPlace, other: EffectPlace) -> Hidden | None:
    """Return an effect that no third one, and no outlier, can replace beside another; None if it is too large."""
    direction = draw_direction(rng, plain(place))
    same = {*joint.classes.whole_class(place), *joint.classes.whole_class(other)}
    rivals = {rival.title: joint.columns_of([rival]) for rival in joint.classes.places if rival not in same}
    base = np.hstack([joint.rows.nominal, joint.columns_of([other])])
    sizes = sizes_of_change(base, joint.columns_of([place]) @ direction, rivals)
    return hidden_at(place, direction, ABOVE * sizes.excluded, sizes)


def hidden_in(rng: np.random.Generator, bench: TrialBench, clean: PositionRecord, options: Options) -> Hidden | None:
    """Return an effect for a whole bench with this clean record, at a size of the mode; None if none is possible.

    The effect is linear, with a time if it sets in; by default it has `ABOVE` times the size that excludes every rival.
    """
    model = whole_evidence(clean, bench.place, noise_bound=NOISE_BOUND).model
    classes = model.classes
    hideable = [*places_of_classes(classes), *model.starting]
    names = sorted({place.effect for place in hideable if not options.effects or place.effect in options.effects})
    if not names:
        return None
    name = names[rng.integers(len(names))]
    possible = [place for place in hideable if place.effect == name]
    place = possible[rng.integers(len(possible))]
    in_time = place in model.starting
    if in_time:
        at_time = model.with_onset(place, drawn_time(rng, model, place))
    else:
        at_time = model
    direction = draw_direction(rng, place)
    change = at_time.columns_of([place]) @ direction
    columns = {}
    if options.size is None:
        for rival in classes.places:
            if place not in classes.whole_class(rival):
                columns[rival.title] = model.columns_of([rival])
        for rival in model.starting:
            # An effect that contains it comes later.
            if rival != place and place.effect not in rival.definition.contains:
                columns[rival.title] = most_alike(model, rival, change)
    sizes = sizes_of_change(model.rows.nominal, change, columns)
    size = ABOVE * sizes.excluded
    if options.size is not None:
        size = relative_size(rng, sizes, options.size)
    if not np.isfinite(size) or size > largest_possible_size(place, direction):
        return None
    values = at_time.values_of([place], np.append(np.zeros(len(at_time.names)), size * direction))[place]
    hidden = Hidden(place, values, float(size), sizes)
    # An effect at rest counts from the first rest on.
    began = model.rests.readings.circumstances.began / 3600.0
    if in_time and acts_at_rest(place):
        return hidden.since(-began)
    return hidden
