"""Components that start with the findings of a record, and scenarios that simulate the record with them.

In a record of a table each rest lies about the time of its row, so that the mean of a run over the rest belongs to that
row. The first rest begins with the run, because the hours begin there.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus import build
from ...fmus.catalogue import COMPONENTS
from ...fmus.component import started
from ...fmus.parameters import Parameters, component_parameters, elements_of
from ...models.arrays import Bools, Floats
from ...models.bench import TARGETS
from ...models.effects import EffectPlace
from ..calibration.parameter_sets import Sized, Start
from ..orchestrator.scenario import Scenario, write_scenario
from .bench_model import Readings
from .bench_visits import Circumstances
from .fit import Fit

FAST = 1e6
"""Rate [rad/s] and acceleration [rad/s²] of a simulated table whose moves take no time to speak of."""
APPROACH = 0.02
"""Angle from which the simulated table comes to a position in the sense of the record [rad]."""
STEPS_PER_GAP = 64
"""Steps in the shortest time between two rows."""
HALF_REST = 12
"""Steps for which the table stands at a position before its time, and after it."""
SHORT_STOP = 6
"""Steps of a stop that no search for rests takes for one."""
MAX_STEPS = 400_000
"""A record whose rows crowd together within a long time is not simulated again."""
RUN_OF_TABLE: dict[str, object] = {
    "encoder_fluctuation_bound": 0.0,
    "earth_rotation": False,
    "max_rate": [FAST, FAST],
    "max_acceleration": [FAST, FAST],
}
"""Parameters of the table that belong to such a run."""
TABLE_AND_BLOCK = {"table": "TurntableMotion", "block": "AccelerometerBlock"}
FED = {"specific_force": "specific_force", "angle": "angle", "block_rate": "rate"}
"""Outputs of the table and the inputs of the block that they feed, the needs of effects among them."""
READINGS = {f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)}
ANGLES = {"alpha_deg": "table.angle_reading[1]", "beta_deg": "table.angle_reading[2]"}
"""Columns of a record, and the variables that are recorded as them."""


def takes(
    component: str, values: Mapping[str, float | list[float]], effects: Mapping[EffectPlace, Sequence[float]]
) -> bool:
    """Return whether a component accepts values of its parameters and of its effects."""
    sized = {}
    for place, sizes in effects.items():
        sized[place] = sizes, [(-math.inf, math.inf)] * len(sizes)
    try:
        Start.of(component, dict(values), {}, sized)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class Extension:
    """Components with the findings of a record, and the scenarios that simulate it, by the names of their files."""

    starts: Sequence[Start]
    scenarios: Mapping[str, Scenario]

    def with_noise(self, blocks: Mapping[str, Parameters]) -> "Extension":
        """Return the extension whose components, by their names, also start with these noise parameters."""
        starts = []
        for start in self.starts:
            values = blocks.get(start.component.name, {})
            component = started(start.component, values)
            starts.append(replace(start, component=component, values={**start.values, **values}))
        extended = {start.component.name for start in starts}
        for name, values in blocks.items():
            if name not in extended:
                starts.append(Start(name, started(COMPONENTS[name], values), values, {}))
        return Extension(starts, self.scenarios)

    def write(self, folder: Path, said: str, flavour: str) -> list[Path]:
        """Write FMUs of a flavour, each with its values and intervals (.ssv), and the scenarios; return all files.

        `said` is the description of the parameter sets.
        """
        files = [build(s.component, folder, flavour=flavour) for s in self.starts if s.name == s.component.name]
        for start in self.starts:
            if not start.values:
                continue
            files.append(folder / f"{start.name}.ssv")
            start.write(files[-1], said)
        for name, scenario in self.scenarios.items():
            files += write_scenario(scenario, folder / f"{name}.toml")
        return files


# Records of a table


@dataclass(frozen=True)
class Visited:
    """Positions visited one after the other.

    `commands` (n, 2): commanded angles [rad]; `senses`, `moved` (n, 2): sense of the last move of each axis, and true
    if it turned on the way; `circumstances`: of each position. The table approaches a position in the sense that the
    record gives, else straight from the position before.
    """

    commands: Floats
    senses: Floats
    moved: Bools
    circumstances: Circumstances

    @staticmethod
    def of(readings: Readings, commands: NDArray, rows: NDArray) -> "Visited":
        """Some rows (n,) of int of a record, with the commands (N, 2) of all."""
        moved, circumstances = np.stack(readings.moved_axes(), axis=1)[rows], readings.circumstances.selected(rows)
        senses = np.stack((circumstances.sense_alpha, circumstances.sense_beta), axis=1)
        # The shorter turn from position to position gives the sense.
        turns = np.remainder(np.diff(commands[rows], axis=0) + np.pi, 2.0 * np.pi) - np.pi
        straight = commands[rows[0]] + np.vstack([np.zeros((1, 2)), np.cumsum(turns, axis=0)])
        return Visited(commands[rows] if circumstances.approached else straight, senses, moved, circumstances)

    @property
    def seconds(self) -> Floats:
        """Times (n,) [s] since the record's first row."""
        return 3600.0 * self.circumstances.hours

    @property
    def times(self) -> Floats:
        """Times (n,) [s] of the record."""
        return self.circumstances.began + self.seconds

    @property
    def step(self) -> float:
        """Step of a run [s]."""
        return smallest_gap(self.circumstances) / STEPS_PER_GAP

    @property
    def away(self) -> Floats:
        """Difference (n, 2) [rad] of each position from the point where the table's approach to it begins."""
        # An axis that did not turn must not decide the inputs' senses, unless neither did.
        turning = self.moved | ~self.moved.any(axis=1, keepdims=True)
        return APPROACH * self.senses * turning

    def rows(self) -> dict[str, Floats]:
        """Timed rows of commands [rad] and temperature: each holds from its time on.

        Between rests the table swings about the position before, so that no stop there is taken for one.
        """
        seconds, longest, half = self.seconds, SHORT_STOP * self.step, HALF_REST * self.step
        # The table reaches a command at the end of the step with that command.
        arrive, leave = np.maximum(seconds - half - self.step, 0.0), seconds + half - self.step
        temperature = self.circumstances.temperature
        degrees = np.full(len(seconds), 20.0) if temperature is None else temperature
        rows = []
        for k, (command, away) in enumerate(zip(self.commands, self.away, strict=True)):
            begin, before = (leave[k - 1], self.commands[k - 1]) if k else (0.0, command)
            stops = math.ceil((arrive[k] - begin) / longest - 1e-6)
            # Straight from one position to the next: the last stop is the table's last position.
            stops += stops % 2 if not self.circumstances.approached else 0
            swung = before - (away if away.any() else APPROACH)
            places = [before if n % 2 else swung for n in range(stops)]
            if stops and self.circumstances.approached:
                places[-1] = command - away
            times = begin + (arrive[k] - begin) * np.arange(stops) / max(stops, 1)
            # An effect that follows the temperature with a lag also needs the temperature between rests.
            warmth = np.append(np.interp(times + 0.5 * longest, seconds, degrees), degrees[k])
            times = np.append(times, arrive[k])
            places.append(command)
            for time, (alpha, beta), warm in zip(times, places, warmth, strict=True):
                rows.append((self.circumstances.began + time, alpha, beta, warm))
        names = ("time_s", "alpha_rad", "beta_rad", "temperature_degC")
        return dict(zip(names, np.array(rows).T, strict=True))

    def scenario(self, title: str, fmus: Mapping[str, Mapping[str, Any]], columns: Mapping[str, str]) -> Scenario:
        """Return the run of the FMUs `table` and `block`, each with its entries in a scenario file, and `columns`."""
        initial = (self.commands[0] - self.away[0]).tolist()
        parameters_of_table = {**RUN_OF_TABLE, "initial_angle": initial, **fmus["table"].get("parameters", {})}
        driven = {"table.command[1]": "alpha_rad", "table.command[2]": "beta_rad"}
        driven |= dict.fromkeys(("table.temperature", "block.temperature"), "temperature_degC")
        began, steps = self.circumstances.began, math.ceil(self.seconds[-1] / self.step) + HALF_REST
        timed = {name: values.tolist() for name, values in self.rows().items()}
        description = {
            "schema": "trihedron.scenario/1",
            "title": title,
            "run": {"start_s": began, "step_s": self.step, "stop_s": began + steps * self.step},
            "fmus": {**fmus, "table": {**fmus["table"], "parameters": parameters_of_table}},
            "connections": [{"from": f"table.{output}", "to": f"block.{name}"} for output, name in FED.items()],
            "stimuli": [{"table": timed, "columns": driven}],
            "record": {"columns": dict(columns)},
        }
        return Scenario.model_validate(description)


def extension_of_bench(readings: Readings, fit: Fit, ends: NDArray, effects: Sized, gravity: float) -> Extension:
    """Return table and block with a fit's parameters, ends (P, 2) and effects, and a run for each mounting.

    `gravity` is the model's g [m/s²]. The FMUs start with the first mounting; the scenario of another one holds its
    changes.
    """
    p, point = readings.parametrisation, fit.estimate[: len(fit.point)]
    at = readings.true_angles(point, [(place, fit.stated[block]) for place, block, _ in fit.ways])
    commands = np.stack((at.alpha, at.beta), axis=1)
    starts, scenarios = [], {}
    for index, (mounting, matrix) in enumerate(zip(p.mountings, p.matrices, strict=True)):
        # The parameter of each target.
        ending, columns = "" if index == 0 else f"-{index + 1}", np.argmax(p.selection[index], axis=1)

        def said(values: NDArray, columns: NDArray = columns, matrix: NDArray = matrix) -> dict[str, Parameters]:
            return component_parameters(dict(zip(TARGETS, values[columns].tolist(), strict=True)), gravity, matrix)

        least_values, most_values = ends.T
        parameters, depends = said(point), said(np.full(len(point), np.nan))
        low, high = said(least_values), said(most_values)
        fmus: dict[str, dict[str, Any]] = {}
        for name, component in TABLE_AND_BLOCK.items():
            fmus[name] = {"fmu": f"{component}.fmu"}
            least, most = elements_of(low[component]), elements_of(high[component])
            intervals = {}
            for element, unknown in elements_of(depends[component]).items():
                if np.isnan(unknown):
                    intervals[element] = least[element], most[element]
            if index == 0 or name == "table":
                starts.append(Start.of(component, parameters[component], intervals, effects, ending))
        if index:
            of_table = parameters["TurntableMotion"]
            fmus["table"]["parameters"] = {key: of_table[key] for key in ("mounting", "mounting_error")}
        visited = Visited.of(readings, commands, np.flatnonzero(at.mounting == index))
        if can_be_run(visited.circumstances):
            title = f"the positions of a record again, with what was found of it (mounting {mounting})"
            scenarios[f"scenario{ending}"] = visited.scenario(title, fmus, ANGLES | READINGS)
    return Extension(starts, scenarios)


def smallest_gap(circumstances: Circumstances) -> float:
    """Shortest time [s] between two rows."""
    return float(np.diff(3600.0 * circumstances.hours).min()) if len(circumstances.hours) > 1 else 8.0


def can_be_run(circumstances: Circumstances) -> bool:
    """Return whether a run through all rows has few enough steps."""
    return 3600.0 * circumstances.hours[-1] * STEPS_PER_GAP <= MAX_STEPS * smallest_gap(circumstances)
