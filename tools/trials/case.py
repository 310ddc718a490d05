"""A case: an instrument with its secret; and the options of a suite of cases."""

from dataclasses import dataclass
from typing import Any

from ...models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace
from ..errors import InputError, nearest
from ..own_effects import OwnEffects
from .bench import TrialBench, measured_on_days
from .faults import Fault
from .sizes import Hidden

MODES = ("clean", "single", "between", "pairs", "faults", "beside")
WITH_FAULT = ("faults", "beside")
"""Modes with a wrong row or a break: alone, and beside an effect of `single`."""
NOISES = ("uniform", "edge", "correlated")
NOT_DRAWN = ("exchanged-readings",)
"""Effects that no suite of a table's positions hides: exchanged channels have no size near that of detection."""
TAKEN_OUT = ("gyro-bias",)
"""Effects that never show: the mean over the rests is subtracted from every record before the judgement."""
IN_MOTION = tuple(name for name, effect in CATALOGUE.items() if effect.in_motion and name != "lever-arm")
"""Effects that only a record in motion shows."""
OF_SEVERAL, MOST_RECORDS = ("pairs", "clean"), 10
"""Modes of several records of one instrument, and the largest number of records."""
BLOCK_SIZES = (2.0, 3.0)
"""Range of sizes relative to that of sure detection, in records of a moved block."""


@dataclass(frozen=True, eq=False)
class Case:
    """A record to make: an instrument with its secret."""

    seed: int
    index: int | None
    """number of the case in its suite, where the seed decides everything; None: a single record"""
    instrument: Any
    """`TrialBench` with a table, or `Block` moved by hand"""
    hidden: tuple[Hidden, ...] = ()
    """hidden effects; empty for a clean record"""
    redrawn: int = 0
    """number of effects that were drawn and rejected because no possible size fits"""
    fault: Fault | None = None
    """a wrong row or a break, done to the record"""
    days: tuple[TrialBench, ...] = ()
    """for several records of one block: the bench of each day; the first one is the instrument"""

    @property
    def places(self) -> tuple[EffectPlace, ...]:
        """Places of the hidden effects."""
        places = []
        for hidden in self.hidden:
            places.append(hidden.place)
        return tuple(places)

    def measured(self, *, progress: bool = False) -> Any:
        """Return the record, of positions or strapdown, or several by label, as a laboratory would hand it over."""
        if self.days:
            return measured_on_days(self.days, self.seed, self.index, self.hidden, progress=progress)
        record = self.instrument.measured(self.seed, self.index, self.hidden, progress=progress)
        return record if self.fault is None else self.fault.done_to(record, self.instrument)

    def answer(self) -> dict[str, Any]:
        """Return the secret, for a comparison."""
        return self.instrument.answer(self.seed, self.index, self.hidden)


@dataclass(frozen=True)
class Options:
    """Options for drawing cases."""

    mode: str = "single"
    """one of `MODES`: "clean"; "single", one effect at `ABOVE` times the size that excludes every rival, in a block one
    of `BLOCK_SIZES`; "between", for benches, one between that size and the size of sure detection; "pairs", two at
    these sizes; "faults", a wrong row or a break; "beside", one of these beside one effect"""
    effects: tuple[str, ...] = ()
    """names to draw from; empty: all that a record can hide"""
    positions: tuple[int, int] = (12, 100)
    """fewest and most positions of a table"""
    noise: str = "all"
    """noise of benches: "uniform", "edge" (every error at ±σ), "correlated" (it wanders within ±σ) or "all", one after
    the other"""
    size: tuple[float, float] | None = None
    """sizes relative to that of sure detection, in place of those of the mode"""
    strapdown: bool = False
    """True for records of a block moved by hand, False for a table's positions"""
    records: int = 1
    """number of days of one block at a table; with several, "pairs" is one effect in all records and one in a single
    record"""
    own: OwnEffects | None = None
    """a file of the user's own effects, which are tried too, and may be hidden"""
    whole: bool = False
    """True for records of a whole bench, with gyros that sense the table's turns"""

    def __post_init__(self) -> None:
        if self.strapdown:
            self._check_of_block()
            return
        if self.whole and self.mode not in ("clean", "single"):
            raise InputError(f"--mode {self.mode}: of a whole bench there is clean and single")
        if self.mode not in MODES:
            raise InputError(f"--mode {self.mode}: {nearest(self.mode, MODES)}")
        if self.noise not in (*NOISES, "all"):
            raise InputError(f"--noise {self.noise}: {nearest(self.noise, (*NOISES, 'all'))}")
        for name in self.effects:
            if self.whole:
                every = (*hidden_effects(), *IN_MOTION)
            else:
                every = hidden_effects()
            if name not in every:
                raise InputError(f"--effects {name}: {nearest(name, every)}")
        if not 1 <= self.records <= MOST_RECORDS:
            raise InputError(f"--records {self.records}: must be a whole number from 1 to {MOST_RECORDS}")
        if self.records > 1 and (self.mode not in OF_SEVERAL or self.size is not None):
            option = "--size"
            if self.size is None:
                option = f"--mode {self.mode}"
            raise InputError(f"{option}: is of one record; of several there is --mode {' or '.join(OF_SEVERAL)}")
        low, high = self.positions
        if not 6 <= low <= high <= 1000:
            raise InputError(f"--positions {low} {high}: must be two whole numbers from 6 to 1000, the lesser first")
        if self.size is not None and not 0.0 < self.size[0] <= self.size[1] < 1e6:
            raise InputError(
                f"--size {self.size[0]:g} {self.size[1]:g}: must be two positive numbers, the lesser first"
            )

    def _check_of_block(self) -> None:
        low, high = self.sizes
        if not 0.0 < low <= high <= 1e3:
            raise InputError(f"--size {low:g} {high:g}: give the least and the greatest, above 0")
        for name in () if self.mode == "clean" else self.effects:
            if name not in hideable_in_block():
                raise InputError(
                    f"--effect {name}: not one that can be hidden here; {nearest(name, hideable_in_block())}"
                )

    @property
    def sizes(self) -> tuple[float, float]:
        """Least and largest size of an effect in a block, relative to that of sure detection."""
        return self.size or BLOCK_SIZES


def hidden_effects() -> tuple[str, ...]:
    """Return the effects that a suite of a table's positions hides."""
    return tuple(name for name in POSITION_EFFECTS if name not in NOT_DRAWN)


def hideable_in_block() -> tuple[str, ...]:
    """Return the names of effects that some record of a moved block can hide."""
    names = []
    for effect in STRAPDOWN_EFFECTS.values():
        if effect.variants is None and effect.name not in TAKEN_OUT:
            names.append(effect.name)
    for effect in POSITION_EFFECTS.values():
        if effect.component == "AccelerometerBlock" and effect.linear:
            names.append(effect.name)
    return tuple(names)


def check_seed(seed: int) -> None:
    """Refuse a seed that the components' generators do not take."""
    if not 0 <= seed < 2**31:
        raise InputError(f"--seed {seed}: must be a whole number from 0 to {2**31 - 1}")
