"""A table with a block on it, made of the FMUs and driven by a test: it writes readings like a laboratory's logger."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from trihedron.tools.evidence import composed
from trihedron.tools.orchestrator import run_scenario
from trihedron.tools.trials import draw_truth
from trihedron.tools.trials.bench import BLOCK_NOISE, ENCODER_FLUCTUATION

HEADER = "time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2\n"
STEP_S = 0.25


class SimulatedTable:
    """Drives the FMUs from position to position; `hidden` are effects as in a scenario.

    Attributes
    ----------
    file : Path
        file that grows with each position
    time_s : float
        time of its last row [s]
    """

    def __init__(self, file: Path, *, seed: int = 1, hidden: Sequence[dict] = (), step_s: float = STEP_S):
        self.file, self.time_s, self._angle, self._seed = file, 0.0, (-0.3, -0.3), seed
        self._truth = draw_truth(np.random.default_rng(seed), symmetric=False)
        self._hidden = list(hidden)
        self._step = step_s
        self._first = True

    def rows(self, alpha_deg: float, beta_deg: float, dwell_s: float = 6.0) -> np.ndarray:
        """Return readings (n, 6) of the move to a position and the rest there: time, angles [deg], readings [m/s²]."""
        self._seed += 1
        table = {
            **self._truth["TurntableMotion"],
            "encoder_fluctuation_bound": ENCODER_FLUCTUATION,
            "initial_angle": list(self._angle),
            "seed": self._seed,
        }
        block = {
            **self._truth["AccelerometerBlock"],
            "noise_bound": BLOCK_NOISE,
            "held_fraction": 0.8,
            "seed": self._seed,
        }
        names = ("alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2")
        ports = ("table.angle_reading[1]", "table.angle_reading[2]", *(f"block.reading[{p}]" for p in (1, 2, 3)))
        run = run_scenario(
            composed(
                "a move and a rest",
                {"table": ("TurntableMotion", table), "block": ("AccelerometerBlock", block)},
                self._hidden,
                dict(zip(names, ports, strict=True)),
                run={"step_s": self._step},
                connections=[
                    {"from": "table.specific_force", "to": "block.specific_force"},
                    {"from": "table.angle", "to": "block.angle"},
                    {"from": "table.dwell", "to": "block.dwell"},
                ],
                stimuli=[
                    {
                        "to": "table.command",
                        "table": {"alpha_deg": [alpha_deg], "beta_deg": [beta_deg]},
                        "dwell_s": dwell_s,
                    }
                ],
            )
        )
        result = np.column_stack([run[name] for name in ("time_s", *names)])
        result = result if self._first else result[1:]
        result[:, 0] += self.time_s
        self._first, self.time_s = False, float(result[-1, 0])
        self._angle = (math.radians(alpha_deg), math.radians(beta_deg))
        return result

    def go(self, alpha_deg: float, beta_deg: float, dwell_s: float = 6.0, *, knocked: bool = False) -> None:
        """Go to a position, rest there, and append the readings; a knock spoils one row of the rest."""
        rows = self.rows(alpha_deg, beta_deg, dwell_s)
        if knocked:
            rows[-len(rows) // 8, 4] += 150.0
        self.write(text_of(rows))

    def write(self, text: str) -> None:
        """Append to the file, after a header if it is new."""
        new = not self.file.exists()
        with self.file.open("a", encoding="utf-8") as file:
            file.write(HEADER + text if new else text)


def text_of(rows: np.ndarray) -> str:
    """Return rows as lines of CSV, with nine decimals of readings and seven of angles."""
    return "".join(
        f"{row[0]:.3f},{row[1]:.7f},{row[2]:.7f},{row[3]:.9f},{row[4]:.9f},{row[5]:.9f}\n" for row in rows.tolist()
    )
