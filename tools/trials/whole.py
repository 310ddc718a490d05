"""Whole benches to hide effects in: a table that carries accelerometers and gyros through positions and whole turns.

Table, accelerometer block and gyro block are simulated in time, with the effects composed in.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibration.gyros import Bench as Place
from ..evidence.fit import composed
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from ..records import PositionRecord, read_record
from .bench import BLOCK_NOISE, ENCODER_FLUCTUATION, draw_truth, temperature_at
from .sizes import Hidden

STEP_S, DWELL_S = 0.02, 4.0
"""A record has fifty rows a second; the table rests so long at each position."""
ROW_NOISE, GYRO_NOISE = 8e-6, 4e-6
"""Bounds of a gyro's error in one row and of its mean over one second, six standard deviations [rad/s]: 0.002°/√h."""
POSITIONS = (24, 40)
"""Fewest and most positions between which the table takes the shorter way."""
TURNS = ((720.0, 0.0), (0.0, 90.0), (720.0, 90.0), (0.0, 180.0), (720.0, 270.0), (90.0, 270.0), (90.0, 990.0))
"""Positions [deg] that follow: whole turns about the outer axis at several inner angles, then about the inner one."""


@dataclass(frozen=True)
class WholeBench:
    """A bench with accelerometers and gyros, and its programme of positions `angles` (N, 2) [rad], whole turns counted.

    `truth`: component -> variable -> value; `latitude`, `azimuth` [rad] of the outer axis.
    """

    truth: dict[str, dict[str, Any]]
    angles: NDArray[np.float64]
    latitude: float
    azimuth: float

    @property
    def place(self) -> Place:
        """What a laboratory says of its bench."""
        return Place(
            math.degrees(self.latitude), math.degrees(self.azimuth), GYRO_NOISE, encoder_bound=ENCODER_FLUCTUATION
        )

    def measured(
        self, seed: int, index: int | None = None, hidden: Sequence[Hidden] = (), *, progress: bool = False
    ) -> PositionRecord:
        """The rests of what the bench reads with a secret; arguments as for a bench of positions."""
        run = simulate(self.scenario(hidden, seed * 100_003 + (index or 0)), progress=progress)
        return read_record(run.table, PositionRecord)

    def scenario(self, hidden: Sequence[Hidden], seed: int) -> Scenario:
        """The scenario in which the table carries both blocks from position to position; the seed is of all errors."""
        table = {
            **self.truth["TurntableMotion"],
            "encoder_fluctuation_bound": ENCODER_FLUCTUATION,
            "initial_angle": self.angles[0].tolist(),
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
            [one.entry for one in hidden],
            {
                "alpha_deg": "table.angle_reading[1]",
                "beta_deg": "table.angle_reading[2]",
                **{f"dtheta{p}_rad": f"gyros.increment_reading[{p}]" for p in (1, 2, 3)},
                **{f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
                "temperature_degC": "block.temperature",
            },
            run={"step_s": STEP_S},
            connections=[
                *({"from": f"table.{name}", "to": f"block.{name}"} for name in told),
                *({"from": f"table.{name}", "to": f"gyros.{name}"} for name in ("increment", "specific_force")),
            ],
            stimuli=[
                {
                    "to": "table.command",
                    "table": dict(zip(("alpha_deg", "beta_deg"), np.degrees(self.angles).T.tolist(), strict=True)),
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
    return WholeBench(truth, angles, float(rng.uniform(-1.2, 1.2)), float(rng.uniform(-math.pi, math.pi)))
