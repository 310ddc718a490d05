"""Whole benches to hide effects in: a table that carries accelerometers and gyros through positions and whole turns.

Table, accelerometer block and gyro block are simulated in time, with the effects composed in.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..calibration.gyros import Bench as Place
from ..evidence.bench import Bench as Evidence
from ..evidence.bench_in_motion import whole_evidence
from ..evidence.bench_travel import OF_GYROS, acts_at_rest
from ..evidence.fit import composed
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from ..records import BenchRecord, PositionRecord, RawRecord, read_record
from .bench import BLOCK_NOISE, ENCODER_FLUCTUATION, NOISE_BOUND, Bench, draw_truth, temperature_at
from .block import UNDERSAMPLING, without_coning
from .case import Options
from .sizes import Hidden, draw_direction, drawn_time, largest_size, most_alike, sizes_of_change

STEP_S, DWELL_S = 0.02, 4.0
"""A record has fifty rows a second; the table rests so long at each position."""
ROW_NOISE, GYRO_NOISE = 8e-6, 4e-6
"""Bounds of a gyro's error in one row and of its mean over one second, six standard deviations [rad/s]: 0.002°/√h."""
POSITIONS = (24, 40)
"""Fewest and most positions between which the table takes the shorter way."""
TURNS = ((720.0, 0.0), (0.0, 90.0), (720.0, 90.0), (0.0, 180.0), (720.0, 270.0), (90.0, 270.0), (90.0, 990.0))
"""Positions [deg] that follow: whole turns about the outer axis at several inner angles, then about the inner one."""


@dataclass(frozen=True)
class WholeBench(Bench):
    """A bench with accelerometers and gyros; `alpha`, `beta` (N,) [rad] of its programme count whole turns.

    `latitude`, `azimuth` [rad] of the outer axis.
    """

    latitude: float = 0.0
    azimuth: float = 0.0
    step_s: float = STEP_S
    """from one row of the record to the next [s]"""

    decimals: ClassVar[None] = None
    """The numbers of its record are written whole."""

    def as_measured(self, record: PositionRecord) -> RawRecord:
        """The record as a laboratory has it: the series, not its rests."""
        assert record.raw is not None
        return record.raw

    @property
    def asked(self) -> dict[str, Any]:
        """What is known beside the record."""
        return {**super().asked, "bench": self.place}

    @property
    def place(self) -> Place:
        """What a laboratory says of its bench."""
        return Place(
            math.degrees(self.latitude), math.degrees(self.azimuth), GYRO_NOISE, encoder_bound=ENCODER_FLUCTUATION
        )

    def as_recorded(self, hidden: Sequence[Hidden], evidence: Evidence) -> tuple[Hidden, ...]:
        """As of a bench of positions; what gyros do counts from the record's first row, as the run does."""
        own = [one.place.definition.component in OF_GYROS for one in hidden]
        moved = super().as_recorded(hidden, evidence)
        return tuple(one if of_gyros else late for one, late, of_gyros in zip(hidden, moved, own, strict=True))

    def measured(
        self, seed: int, index: int | None = None, hidden: Sequence[Hidden] = (), *, progress: bool = False
    ) -> PositionRecord:
        """The rests of what the bench reads with a secret; arguments as for a bench of positions."""
        run = simulate(self.run_of(hidden, seed * 100_003 + (index or 0)), progress=progress)
        rests, place = read_record(run.table, PositionRecord), self.place
        told = {name: str(value) for name, value in vars(place).items() if value is not None}
        raw = rests.raw
        assert isinstance(raw, BenchRecord)
        for one in hidden:
            if one.place.effect == UNDERSAMPLING and raw.increment is not None:
                raw = replace(raw, increment=without_coning(raw.increment, one.values[0]))
        return replace(rests, raw=replace(raw, about=told))

    def run_of(self, hidden: Sequence[Hidden], seed: int) -> Scenario:
        """The scenario in which the table carries both blocks from position to position; the seed is of all errors."""
        angles = np.stack([self.alpha, self.beta], axis=1)
        table = {
            **self.truth["TurntableMotion"],
            "encoder_fluctuation_bound": ENCODER_FLUCTUATION,
            # The first command's own digits: what rounding leaves would be a move, whose sense no record tells.
            "initial_angle": np.radians(np.degrees(angles[0])).tolist(),
            "latitude": self.latitude,
            "azimuth": self.azimuth,
            "seed": seed % 2**31,
        }
        block = {**self.truth["AccelerometerBlock"], "noise_bound": BLOCK_NOISE, "held_fraction": 0.8}
        gyros = {**self.truth["GyroBlock"], "noise_bound": ROW_NOISE}
        seconds = np.arange(0.0, 4000.0, 1.0)
        warmth = {"time_s": seconds.tolist(), "temperature_degC": temperature_at(seconds / 3600.0).tolist()}
        told = ("specific_force", "angle", "dwell")
        return composed(
            "a whole bench",
            {
                "table": ("TurntableMotion", table),
                "block": ("AccelerometerBlock", {**block, "seed": (seed + 1) % 2**31}),
                "gyros": ("GyroBlock", {**gyros, "seed": (seed + 2) % 2**31}),
            },
            [one.entry for one in hidden if one.place.effect != UNDERSAMPLING],
            {
                "alpha_deg": "table.angle_reading[1]",
                "beta_deg": "table.angle_reading[2]",
                **{f"dtheta{p}_rad": f"gyros.increment_reading[{p}]" for p in (1, 2, 3)},
                **{f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
                "temperature_degC": "block.temperature",
            },
            run={"step_s": self.step_s},
            connections=[
                *({"from": f"table.{name}", "to": f"block.{name}"} for name in told),
                {"from": "table.block_rate", "to": "block.rate"},
                *({"from": f"table.{name}", "to": f"gyros.{name}"} for name in ("increment", "specific_force")),
            ],
            stimuli=[
                {
                    "to": "table.command",
                    "table": dict(zip(("alpha_deg", "beta_deg"), np.degrees(angles).T.tolist(), strict=True)),
                    "dwell_s": DWELL_S,
                },
                {
                    "table": warmth,
                    "columns": dict.fromkeys(
                        ("table.temperature", "block.temperature", "gyros.temperature"), "temperature_degC"
                    ),
                },
            ],
        )


def draw_whole(rng: np.random.Generator) -> WholeBench:
    """Draw a bench, accelerometers and gyros within usual bounds, positions, and whole turns after them."""
    truth = draw_truth(rng, symmetric=False)
    truth["GyroBlock"] = {
        "bias": rng.uniform(-2e-3, 2e-3, 3).tolist(),
        "scale_misalignment": rng.uniform(-8e-3, 8e-3, 9).tolist(),
    }
    count = int(rng.integers(POSITIONS[0], POSITIONS[1] + 1))
    drawn = rng.uniform(-math.pi, math.pi, (count, 2))
    angles = np.vstack([drawn, [[0.0, 0.0]], np.radians(TURNS)])
    error = tuple(truth["TurntableMotion"]["mounting_error"])
    latitude, azimuth = float(rng.uniform(-1.2, 1.2)), float(rng.uniform(-math.pi, math.pi))
    alpha, beta = angles.T
    return WholeBench(
        truth,
        False,
        ("identity",),
        (error,),
        alpha,
        beta,
        np.zeros(len(alpha), dtype=int),
        "uniform",
        latitude,
        azimuth,
    )


def hidden_in(
    rng: np.random.Generator, bench: WholeBench, clean: PositionRecord, options: Options, above: float
) -> Hidden | None:
    """An effect for a bench whose clean record is given, at a size of the mode; None where that is not a possible one.

    It is linear, at its time where it sets in; by default so many times as large as excludes each other one.
    """
    evidence = whole_evidence(clean, bench.place, noise_bound=NOISE_BOUND)
    classes = evidence.classes
    shown = [place for first in classes.places for place in classes.whole_class(first)]
    shown += evidence.starting
    names = sorted({place.effect for place in shown if not options.effects or place.effect in options.effects})
    if not names:
        return None
    name = names[rng.integers(len(names))]
    own = [place for place in shown if place.effect == name]
    place = own[rng.integers(len(own))]
    in_time = place in evidence.starting
    here = evidence.with_onset(place, drawn_time(rng, evidence, place)) if in_time else evidence
    direction = draw_direction(rng, place)
    change = here.columns_of([place]) @ direction
    columns = {}
    if options.size is None:
        rivals = [other for other in classes.places if place not in classes.whole_class(other)]
        columns = {other.title: evidence.columns_of([other]) for other in rivals}
        # What contains it comes behind it.
        beside = (p for p in evidence.starting if p != place and place.effect not in p.definition.contains)
        columns |= {other.title: most_alike(evidence, other, change) for other in beside}
    sizes = sizes_of_change(evidence.nominal, change, columns)
    size = above * sizes.excluded
    if options.size is not None:
        size = sizes.detected * float(np.exp(rng.uniform(*np.log(options.size))))
    if not np.isfinite(size) or size > largest_size(place, direction):
        return None
    values = here.values_of([place], np.append(np.zeros(len(here.names)), size * direction))[place]
    hidden = Hidden(place, values, float(size), sizes)
    # What acts at rest counts from the first rest on.
    began = evidence.readings.circumstances.began / 3600.0
    return hidden.since(-began) if in_time and acts_at_rest(place) else hidden
