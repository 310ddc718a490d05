"""Cases drawn from a seed: an instrument, what is hidden in it, and how large that is against what must be seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace
from ...models.effects.outlier import place_of
from ..bounded.programmes import chebyshev_radius
from ..calibration.model import Linearisation
from ..diagnosis.sizes import SureSizes, level_margins, sure_sizes
from ..errors import InputError, nearest
from ..evidence.bench_effects import Circumstances, Visits, senses_of, signature_columns
from ..evidence.carried_record import linear_evidence
from ..evidence.evidence import Classes, Evidence, coefficient_count
from ..motion.inspect import inspect_record
from ..records import StrapdownRecord
from .bench import (
    DWELL_S,
    NOISE_BOUND,
    Bench,
    bench_positions,
    classes_with,
    draw_bench,
    draw_truth,
    expected,
    faultless_model,
    plain_bench,
    temperature_at,
)
from .block import BEFORE_A_CAMERA, BETWEEN_RESTS, draw_instruments, draw_motion
from .measure import FURTHEST_STAMP, STAMPS, BenchCase, BlockCase, Case, Hidden, Reference, measure_block

MODES = ("clean", "single", "between", "pairs")
NOISES = ("uniform", "edge", "correlated")
ABOVE = 1.5
"""So many times the size that excludes every rival an effect has, where it is to be named."""
MOST_ABOVE = 30.0
"""So many times the size of sure detection is the most where nothing else limits it."""
TRIES, BLOCK_TRIES = 10, 40
"""Effects that are drawn for one bench before another one is drawn; for one moved block."""
MOST_BENCHES = 60
"""Benches that are drawn for one case."""
ALONE_SIZES, BLOCK_SIZES = (3.0, 6.0), (2.0, 3.0)
"""Sizes relative to that of sure detection: of a single record of a bench, of records of a moved block."""
RATES_HZ = (50.0, 100.0, 200.0)
BASELINE = {"gravity": "calibrated", "truth": "nominal"}
"""What the diagnosis of a moved block takes for known, by the record's reference."""
TAKEN_OUT = ("gyro-bias",)
"""The mean over the rests is taken out of every record before anything is judged: such a bias shows nowhere."""
UNSEEN_BETWEEN_RESTS = ("latency",)
"""A lag turns nothing from one rest to the next."""


@dataclass(frozen=True)
class BenchOptions:
    """What is drawn of records of a table's positions.

    Attributes
    ----------
    mode : str
        "clean"; "single": one effect at `ABOVE` times the size that excludes every rival; "between": one between that
        size and the one of sure detection; "pairs": two at such sizes
    effects : tuple of str
        names to draw from; empty: the whole catalogue
    positions : (int, int)
        fewest and most
    noise : str
        "uniform", "edge" (every error at ±σ), "correlated" (it wanders within ±σ) or "all", one after the other
    size : (float, float) or None
        sizes relative to that of sure detection, in place of those of the mode
    """

    mode: str = "single"
    effects: tuple[str, ...] = ()
    positions: tuple[int, int] = (12, 100)
    noise: str = "all"
    size: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise InputError(f"--mode {self.mode}: {nearest(self.mode, MODES)}")
        if self.noise not in (*NOISES, "all"):
            raise InputError(f"--noise {self.noise}: {nearest(self.noise, (*NOISES, 'all'))}")
        for name in self.effects:
            if name not in POSITION_EFFECTS:
                raise InputError(f"--effects {name}: {nearest(name, tuple(POSITION_EFFECTS))}")
        low, high = self.positions
        if not 6 <= low <= high <= 1000:
            raise InputError(f"--positions {low} {high}: must be two whole numbers from 6 to 1000, the lesser first")
        if self.size is not None and not 0.0 < self.size[0] <= self.size[1] < 1e6:
            raise InputError(
                f"--size {self.size[0]:g} {self.size[1]:g}: must be two positive numbers, the lesser first"
            )


@dataclass(frozen=True)
class BlockOptions:
    """What is drawn of records of a block moved by hand.

    Attributes
    ----------
    clean : bool
        hide nothing
    effects : tuple of str
        names to draw from; all that a record can hide where there are none
    sizes : (float, float)
        least and largest, relative to that of sure detection
    """

    clean: bool = False
    effects: tuple[str, ...] = ()
    sizes: tuple[float, float] = BLOCK_SIZES

    def __post_init__(self) -> None:
        low, high = self.sizes
        if not 0.0 < low <= high <= 1e3:
            raise InputError(f"--size {low:g} {high:g}: give the least and the greatest, above 0")
        for name in () if self.clean else self.effects:
            if name not in hideable_in_block():
                raise InputError(
                    f"--effect {name}: not one that can be hidden here; {nearest(name, hideable_in_block())}"
                )


Options = BenchOptions | BlockOptions


def draw_case(options: Options, seed: int, index: int) -> Case:
    """Draw case `index` of a suite; it does not depend on how many cases there are.

    Raises
    ------
    InputError
        no bench that was drawn can hide such effects at such sizes, or the record of the moved block cannot show them
    """
    if isinstance(options, BenchOptions):
        return draw_bench_case(options, seed, index)
    return draw_clean_block(seed, index) if options.clean else draw_block_case(options, seed, index)


def check_seed(seed: int) -> None:
    """Refuse a seed that the components' generators do not take."""
    if not 0 <= seed < 2**31:
        raise InputError(f"--seed {seed}: must be a whole number from 0 to {2**31 - 1}")


# Records of a table's positions, in suites


@dataclass(frozen=True)
class _Known:
    """What sizes are computed from: the model at the truth, circumstances, classes, and names to draw from."""

    here: Linearisation
    circumstances: Circumstances
    classes: Classes
    options: BenchOptions
    names: tuple[str, ...]

    def rivals_of(self, places: Sequence[EffectPlace]) -> list[EffectPlace]:
        """One effect of each class that none of some effects belongs to."""
        pairs = zip(self.classes.places, self.classes.members, strict=True)
        return [place for place, members in pairs if not {place, *members} & set(places)]

    def stands_for(self, place: EffectPlace) -> EffectPlace:
        """The effect that an effect's class is named by."""
        pairs = zip(self.classes.places, self.classes.members, strict=True)
        return next((first for first, members in pairs if place in members), place)


def draw_bench_case(options: BenchOptions, seed: int, index: int) -> BenchCase:
    """Draw a bench and what is hidden in it; arguments and errors as for `draw_case`."""
    rng = np.random.default_rng([seed, index])
    noise = NOISES[index % len(NOISES)] if options.noise == "all" else options.noise
    redrawn = 0
    for _ in range(MOST_BENCHES):
        bench = draw_bench(rng, options.positions)
        if options.mode == "clean":
            return BenchCase(seed, index, bench, (), noise)
        here, circumstances = expected(bench)
        if here.deficient:
            redrawn += 1
            continue
        classes = classes_with(bench.mountings, symmetric=bench.symmetric)
        known = _Known(here, circumstances, classes, options, names_in(bench, options))
        for _ in range(TRIES if known.names else 0):
            hidden = _draw_pair(rng, known) if options.mode == "pairs" else _draw_single(rng, known)
            if hidden is not None:
                # What rounds or clips has to act on errors that are there already.
                own = all(CATALOGUE[h.place.effect].variants is None for h in hidden)
                return BenchCase(seed, index, bench, hidden, noise if own else "uniform", redrawn)
            redrawn += 1
    raise InputError(
        f"--mode {options.mode}: no bench of {MOST_BENCHES} with {options.positions[0]} to {options.positions[1]} "
        "positions can hide such an effect at such a size; allow more --positions, or other --effects"
    )


def names_in(bench: Bench, options: BenchOptions) -> tuple[str, ...]:
    """Names of effects that this bench can hide."""
    classes = classes_with(bench.mountings, symmetric=bench.symmetric)
    seen = {place.effect for place in _linear(classes)}
    names = [
        effect.name
        for effect in POSITION_EFFECTS.values()
        if effect.name in seen or effect.name == "outlier" or (effect.variants is not None and options.mode != "pairs")
    ]
    return tuple(name for name in names if not options.effects or name in options.effects)


def _linear(classes: Classes) -> list[EffectPlace]:
    """Every linear effect that is not wholly in the nominal model, those that stand for another one too."""
    return [p for place, members in zip(classes.places, classes.members, strict=True) for p in (place, *members)]


def _draw_place(
    rng: np.random.Generator, name: str, places: Sequence[EffectPlace], positions: int
) -> tuple[EffectPlace, NDArray]:
    """One of an effect's places, or any reading for an outlier, and a direction of its coefficients."""
    if name == "outlier":
        place = place_of(int(rng.integers(positions)) + 1, int(rng.integers(3)) + 1)
    else:
        own = [place for place in places if place.effect == name] or list(CATALOGUE[name].places)
        place = own[rng.integers(len(own))]
    return place, _draw_direction(rng, place, coefficient_count(place))


def _draw_direction(rng: np.random.Generator, place: EffectPlace, count: int) -> NDArray:
    """A direction of so many coefficients, of length one; one that only grows is positive."""
    direction = rng.normal(size=count)
    direction /= np.linalg.norm(direction)
    grows = CATALOGUE[place.effect].at(place).parameters[0].smallest == 0.0
    return np.abs(direction) if grows and count == 1 else direction


def _drawn(rng: np.random.Generator, known: _Known) -> tuple[EffectPlace, NDArray]:
    name = known.names[rng.integers(len(known.names))]
    return _draw_place(rng, name, _linear(known.classes), len(known.here.reading))


def _draw_single(rng: np.random.Generator, known: _Known) -> tuple[Hidden] | None:
    """One effect at a size of the mode; None where no possible size would do."""
    place, direction = _drawn(rng, known)
    if CATALOGUE[place.effect].variants is not None:
        return _draw_level(rng, known, place)
    relative = known.options.size
    rivals = [] if relative is not None else known.rivals_of([place])
    sizes = sure_sizes(known.here, known.circumstances, place, rivals, direction=direction)
    if relative is not None:
        size = sizes.detected * float(np.exp(rng.uniform(*np.log(relative))))
    elif known.options.mode == "single":
        size = ABOVE * sizes.excluded
    else:
        top = min(sizes.excluded, MOST_ABOVE * sizes.detected, _largest_size(place, direction))
        size = rng.uniform(sizes.detected, max(top, sizes.detected)) if np.isfinite(sizes.detected) else np.inf
    return _made(place, direction, size, sizes)


def _draw_pair(rng: np.random.Generator, known: _Known) -> tuple[Hidden, Hidden] | None:
    """Two effects, each at a size at which nothing can stand for it even when the other one is free."""
    (first, along), (second, across) = _drawn(rng, known), _drawn(rng, known)
    if known.stands_for(first) == known.stands_for(second):
        return None
    rivals = known.rivals_of([first, second])
    both = []
    for place, direction, other in ((first, along, second), (second, across, first)):
        sizes = sure_sizes(known.here, known.circumstances, place, rivals, direction=direction, beside=[other])
        hidden = _made(place, direction, ABOVE * sizes.excluded, sizes)
        if hidden is None:
            return None
        both += hidden
    return both[0], both[1]


def _made(place: EffectPlace, direction: NDArray, size: float, sizes: SureSizes) -> tuple[Hidden] | None:
    """The effect at a size; None where that is not a possible one."""
    if not np.isfinite(size) or size > _largest_size(place, direction):
        return None
    values = CATALOGUE[place.effect].at(place).from_coefficients(size * direction)
    return (Hidden(place, values, float(size), sizes),)


def _largest_size(place: EffectPlace, direction: NDArray) -> float:
    """The largest possible size along a direction of the coefficients."""
    effect = CATALOGUE[place.effect].at(place)
    unit = effect.from_coefficients(direction)
    # Phases do not grow with the size.
    growing = zip(effect.parameters, unit, strict=True)
    return min((p.largest / abs(v) for p, v in growing if not p.name.endswith("phase") and v != 0.0), default=0.0)


def _draw_level(rng: np.random.Generator, known: _Known, place: EffectPlace) -> tuple[Hidden] | None:
    """An effect that is not linear, at a level of which the mode's sizes are true; None where none of some is."""
    parameter = CATALOGUE[place.effect].parameters[0]
    size = np.abs(known.here.prediction[:, place.index])
    largest = min(parameter.largest, float(size.max()))
    low = max(parameter.smallest or 0.0, 1e-3 * largest)
    levels = np.exp(rng.uniform(np.log(low), np.log(max(largest, low)), TRIES)).tolist()
    margins = level_margins(known.here, known.circumstances, place, levels, known.rivals_of([place]))
    for level, sizes in zip(levels, margins, strict=True):
        wanted = ABOVE * sizes.excluded <= 1.0
        if known.options.mode == "between":
            wanted = sizes.detected <= 1.0 < sizes.excluded
        if known.options.size is not None:
            wanted = known.options.size[0] <= 1.0 / sizes.detected <= known.options.size[1]
        if wanted:
            return (Hidden(place, (level,), 1.0, sizes),)
    return None


# A single record of a table's positions


def draw_alone(seed: int, *, effects: Sequence[str] | None = None, symmetric: bool = False) -> BenchCase:
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
        return BenchCase(seed, None, bench, ())
    place, direction = _draw_place(rng, names[rng.integers(len(names))], visible, len(alpha))
    unit = signature_columns([place], rows) @ direction
    size = rng.uniform(*ALONE_SIZES) * _sure_size(here.jacobian, unit, NOISE_BOUND)
    effect = CATALOGUE[place.effect].at(place)
    values = effect.from_coefficients(min(size, effect.parameters[0].largest) * direction)
    return BenchCase(seed, None, bench, (Hidden(place, values),))


def _sure_size(nominal: NDArray, unit: NDArray, bound: float) -> float:
    """Size of an effect from which it is surely detected: twice the bound over the distance of its unit.

    That distance, in the maximum norm, is from all that the nominal model can say; nominal (M, P), unit (M,).
    """
    radius, _, _ = chebyshev_radius(nominal, unit, np.ones(len(unit)))
    return 2.0 * bound / radius if radius > 1e-9 else math.inf


# Records of a block moved by hand


def hideable_in_block() -> tuple[str, ...]:
    """Names of effects that some record of a moved block can hide."""
    forces = [e.name for e in POSITION_EFFECTS.values() if e.component == "AccelerometerBlock" and e.variants is None]
    own = [e.name for e in STRAPDOWN_EFFECTS.values() if e.variants is None and e.name not in TAKEN_OUT]
    return (*own, *forces)


def draw_clean_block(seed: int, index: int, reference: Reference | None = None) -> BlockCase:
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
    return BlockCase(seed, index, chosen, motion, instruments, temperature)


def draw_block_case(options: BlockOptions, seed: int, index: int) -> BlockCase:
    """A case with an effect of a size relative to that of sure detection; arguments as for `draw_case`."""
    clean = draw_clean_block(seed, index)
    rng = np.random.default_rng([seed, index, 1])
    evidence = evidence_of(clean, measure_block(clean))
    if evidence is None:
        raise InputError(f"case {index}: its rests do not tell the accelerometers' parameters")
    unseen = (*TAKEN_OUT, *(UNSEEN_BETWEEN_RESTS if clean.reference == "gravity" else ()))
    shown = {place.effect for place in evidence.places if not options.effects or place.effect in options.effects}
    names = sorted(shown - set(unseen))
    for redrawn in range(BLOCK_TRIES if names else 0):
        name = names[rng.integers(len(names))]
        places = [place for place in evidence.places if place.effect == name]
        place = places[rng.integers(len(places))]
        case = _hidden_in(clean, evidence, place, rng, options.sizes)
        if case is not None:
            return replace(case, redrawn=redrawn)
    raise InputError(f"case {index}: a record with {clean.reference} for its reference cannot show such an effect")


def evidence_of(case: BlockCase, record: StrapdownRecord) -> Evidence | None:
    """The evidence that a diagnosis makes of a record; None where it can make none."""
    found = inspect_record(record, gravity=STANDARD_GRAVITY)
    if case.reference == "gravity" and (found.accelerometers is None or found.accelerometers.least_squares is None):
        return None
    return linear_evidence(found, BASELINE[case.reference])


def size_in_block(evidence: Evidence, place: EffectPlace, direction: NDArray) -> float:
    """The size, along a direction of the coefficients, from which the record surely disproves the model."""
    return _sure_size(evidence.nominal, evidence.columns_of([place]) @ direction, 1.0)


def _hidden_in(
    clean: BlockCase, evidence: Evidence, place: EffectPlace, rng: np.random.Generator, sizes: tuple[float, float]
) -> BlockCase | None:
    """The case with an effect in it; None where its size would be more than is called possible."""
    wanted = float(rng.uniform(*sizes))
    effect = CATALOGUE[place.effect].at(place)
    if effect.component == "AttitudeComputer" and not clean.instruments.increments:
        return None
    if place.effect == STAMPS:
        return _with_jitter(clean, place, wanted)
    direction = rng.normal(size=len(effect.parameters))
    direction /= np.linalg.norm(direction)
    if effect.parameters[0].smallest == 0.0:
        direction = np.abs(direction)
    values = effect.from_coefficients(wanted * size_in_block(evidence, place, direction) * direction)
    if not all(np.isfinite(v) and p.possible(v) for v, p in zip(values, effect.parameters, strict=True)):
        return None
    return replace(clean, hidden=(Hidden(place, values, wanted),))


def _with_jitter(clean: BlockCase, place: EffectPlace, wanted: float) -> BlockCase | None:
    """The case with time stamps that jitter while the sampling does not."""
    furthest = replace(clean, hidden=(Hidden(place, (1.0,), wanted),), jitter=FURTHEST_STAMP)
    evidence = evidence_of(furthest, measure_block(furthest))
    if evidence is None or place not in evidence.places:
        return None
    part = wanted * size_in_block(evidence, place, np.ones(1))
    return replace(furthest, jitter=part * FURTHEST_STAMP) if part <= 1.0 else None
