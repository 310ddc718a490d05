"""Cases of the suite: what is hidden in a bench, and how large it is."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, POSITION_EFFECTS, EffectPlace
from ...models.effects.outlier import place_of
from ..calibration.model import Linearisation
from ..diagnosis.circumstances import Circumstances
from ..diagnosis.classes import Classes
from ..diagnosis.disturbance import coefficient_count
from ..diagnosis.sizes import SureSizes, level_margins, sure_sizes
from ..errors import InputError, nearest
from .benches import Bench, classes_with, draw_bench, expected

MODES = ("clean", "single", "between", "pairs")
NOISES = ("uniform", "edge", "correlated")
ABOVE = 1.5
"""So many times the size that excludes every rival an effect has, where it is to be named."""
MOST_ABOVE = 30.0
"""So many times the size of sure detection is the most where nothing else limits it."""
TRIES = 10
"""Effects that are drawn for one bench before another one is drawn."""
MOST_BENCHES = 60
"""Benches that are drawn for one case."""


@dataclass(frozen=True)
class SuiteOptions:
    """What is drawn.

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
            if name not in hideable():
                raise InputError(f"--effects {name}: {nearest(name, hideable())}")
        low, high = self.positions
        if not 6 <= low <= high <= 1000:
            raise InputError(f"--positions {low} {high}: must be two whole numbers from 6 to 1000, the lesser first")
        if self.size is not None and not 0.0 < self.size[0] <= self.size[1] < 1e6:
            raise InputError(
                f"--size {self.size[0]:g} {self.size[1]:g}: must be two positive numbers, the lesser first"
            )


@dataclass(frozen=True)
class Hidden:
    """A hidden effect.

    Attributes
    ----------
    place : EffectPlace
    values : tuple of float
        its parameters
    size : float
        length of the vector of its linear coefficients; 1 for an effect that is not linear
    sizes : SureSizes
        from which it is surely detected, and every rival excluded, in the same measure
    """

    place: EffectPlace
    values: tuple[float, ...]
    size: float
    sizes: SureSizes

    @property
    def relative_size(self) -> float:
        """Size over that of sure detection."""
        return self.size / self.sizes.detected


@dataclass(frozen=True)
class SuiteCase:
    """One case: a bench with its secret.

    Attributes
    ----------
    seed, index : int
        of the suite, and of the case in it: together they decide everything
    bench : Bench
    hidden : tuple of Hidden
        empty for a clean record
    noise : str
        "uniform", "edge" or "correlated"
    redrawn : int
        effects that were drawn and put aside, as no possible size would do
    """

    seed: int
    index: int
    bench: Bench
    hidden: tuple[Hidden, ...]
    noise: str
    redrawn: int = 0

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """What is hidden."""
        return tuple(hidden.place for hidden in self.hidden)


@dataclass(frozen=True)
class Known:
    """What sizes are computed from: the model at the truth, circumstances, classes, and names to draw from."""

    here: Linearisation
    circumstances: Circumstances
    classes: Classes
    options: SuiteOptions
    names: tuple[str, ...]


def hideable() -> tuple[str, ...]:
    """Names of effects that some bench can hide."""
    return tuple(POSITION_EFFECTS)


def draw_case(options: SuiteOptions, seed: int, index: int) -> SuiteCase:
    """Draw case `index` of a suite; it does not depend on how many cases there are.

    Raises
    ------
    InputError
        when no bench that was drawn can hide such effects at such sizes
    """
    rng = np.random.default_rng([seed, index])
    noise = NOISES[index % len(NOISES)] if options.noise == "all" else options.noise
    redrawn = 0
    for _ in range(MOST_BENCHES):
        bench = draw_bench(rng, options.positions)
        if options.mode == "clean":
            return SuiteCase(seed, index, bench, (), noise)
        here, circumstances = expected(bench)
        if here.deficient:
            redrawn += 1
            continue
        classes = classes_with(bench.mountings, symmetric=bench.symmetric)
        known = Known(here, circumstances, classes, options, names_in(bench, options))
        for _ in range(TRIES if known.names else 0):
            hidden = draw_pair(rng, known) if options.mode == "pairs" else draw_single(rng, known)
            if hidden is not None:
                # What rounds or clips has to act on errors that are there already.
                own = all(CATALOGUE[h.place.effect].variants is None for h in hidden)
                return SuiteCase(seed, index, bench, hidden, noise if own else "uniform", redrawn)
            redrawn += 1
    raise InputError(
        f"--mode {options.mode}: no bench of {MOST_BENCHES} with {options.positions[0]} to {options.positions[1]} "
        "positions can hide such an effect at such a size; allow more --positions, or other --effects"
    )


def names_in(bench: Bench, options: SuiteOptions) -> tuple[str, ...]:
    """Names of effects that this bench can hide."""
    classes = classes_with(bench.mountings, symmetric=bench.symmetric)
    seen = {place.effect for place in visible_places(classes)}
    names = [
        effect.name
        for effect in POSITION_EFFECTS.values()
        if effect.name in seen or effect.name == "outlier" or (effect.variants is not None and options.mode != "pairs")
    ]
    return tuple(name for name in names if not options.effects or name in options.effects)


def visible_places(classes: Classes) -> list[EffectPlace]:
    """Every linear effect that is not wholly in the nominal model, those that stand for another one too."""
    return [p for place, members in zip(classes.places, classes.members, strict=True) for p in (place, *members)]


def rivals_of(classes: Classes, places: Sequence[EffectPlace]) -> list[EffectPlace]:
    """One effect of each class that none of some effects belongs to."""
    return [
        place
        for place, members in zip(classes.places, classes.members, strict=True)
        if not {place, *members} & set(places)
    ]


def stands_for(classes: Classes, place: EffectPlace) -> EffectPlace:
    """The effect that an effect's class is named by."""
    pairs = zip(classes.places, classes.members, strict=True)
    return next((first for first, members in pairs if place in members), place)


def draw_place(rng: np.random.Generator, known: Known) -> tuple[EffectPlace, NDArray]:
    """An effect, its place and the direction of its coefficients."""
    name = known.names[rng.integers(len(known.names))]
    if name == "outlier":
        place = place_of(int(rng.integers(len(known.here.reading))) + 1, int(rng.integers(3)) + 1)
    else:
        linear = [place for place in visible_places(known.classes) if place.effect == name]
        places = linear or list(CATALOGUE[name].places)
        place = places[rng.integers(len(places))]
    direction = rng.normal(size=coefficient_count(place))
    direction /= np.linalg.norm(direction)
    if CATALOGUE[name].at(place).parameters[0].smallest == 0.0 and len(direction) == 1:
        direction = np.abs(direction)
    return place, direction


def draw_single(rng: np.random.Generator, known: Known) -> tuple[Hidden] | None:
    """One effect at a size of the mode; None where no possible size would do."""
    place, direction = draw_place(rng, known)
    if CATALOGUE[place.effect].variants is not None:
        return draw_level(rng, known, place)
    relative = known.options.size
    rivals = [] if relative is not None else rivals_of(known.classes, [place])
    sizes = sure_sizes(known.here, known.circumstances, place, rivals, direction=direction)
    if relative is not None:
        size = sizes.detected * float(np.exp(rng.uniform(*np.log(relative))))
    elif known.options.mode == "single":
        size = ABOVE * sizes.excluded
    else:
        top = min(sizes.excluded, MOST_ABOVE * sizes.detected, largest_size(place, direction))
        size = rng.uniform(sizes.detected, max(top, sizes.detected)) if np.isfinite(sizes.detected) else np.inf
    return made(place, direction, size, sizes)


def draw_pair(rng: np.random.Generator, known: Known) -> tuple[Hidden, Hidden] | None:
    """Two effects, each at a size at which nothing can stand for it even when the other one is free."""
    (first, along), (second, across) = draw_place(rng, known), draw_place(rng, known)
    if stands_for(known.classes, first) == stands_for(known.classes, second):
        return None
    rivals = rivals_of(known.classes, [first, second])
    both = []
    for place, direction, other in ((first, along, second), (second, across, first)):
        sizes = sure_sizes(known.here, known.circumstances, place, rivals, direction=direction, beside=[other])
        hidden = made(place, direction, ABOVE * sizes.excluded, sizes)
        if hidden is None:
            return None
        both += hidden
    return both[0], both[1]


def made(place: EffectPlace, direction: NDArray, size: float, sizes: SureSizes) -> tuple[Hidden] | None:
    """The effect at a size; None where that is not a possible one."""
    if not np.isfinite(size) or size > largest_size(place, direction):
        return None
    values = CATALOGUE[place.effect].at(place).from_coefficients(size * direction)
    return (Hidden(place, values, float(size), sizes),)


def largest_size(place: EffectPlace, direction: NDArray) -> float:
    """The largest possible size along a direction of the coefficients."""
    effect = CATALOGUE[place.effect].at(place)
    unit = effect.from_coefficients(direction)
    # Phases do not grow with the size.
    growing = zip(effect.parameters, unit, strict=True)
    return min((p.largest / abs(v) for p, v in growing if not p.name.endswith("phase") and v != 0.0), default=0.0)


def draw_level(rng: np.random.Generator, known: Known, place: EffectPlace) -> tuple[Hidden] | None:
    """An effect that is not linear, at a level of which the mode's sizes are true; None where none of some is."""
    parameter = CATALOGUE[place.effect].parameters[0]
    size = np.abs(known.here.prediction[:, place.index])
    largest = min(parameter.largest, float(size.max()))
    low = max(parameter.smallest or 0.0, 1e-3 * largest)
    levels = np.exp(rng.uniform(np.log(low), np.log(max(largest, low)), TRIES))
    margins = level_margins(known.here, known.circumstances, place, levels.tolist(), rivals_of(known.classes, [place]))
    for level, sizes in zip(levels.tolist(), margins, strict=True):
        wanted = ABOVE * sizes.excluded <= 1.0
        if known.options.mode == "between":
            wanted = sizes.detected <= 1.0 < sizes.excluded
        if known.options.size is not None:
            wanted = known.options.size[0] <= 1.0 / sizes.detected <= known.options.size[1]
        if wanted:
            return (Hidden(place, (level,), 1.0, sizes),)
    return None
