"""Components that start with what was found of a record, and scenarios with which they give the record again."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...fmus import build
from ...fmus.catalogue import COMPONENTS
from ...fmus.component import Component, can_extend, extend, started
from ...fmus.parameters import Parameters, parameter_set
from ...models.effects import EffectPlace, parameter_name
from ..bounded.programmes import Interval
from ..files import whole_file
from ..orchestrator.scenario import Scenario, write_scenario

Sized = Mapping[EffectPlace, tuple[Sequence[float], Sequence[Interval]]]
"""Effects, each with the values of its parameters and the intervals of these."""


@dataclass(frozen=True)
class Start:
    """What a component starts with: `values` of its parameters, and the `ends` of what is possible of their elements.

    `name` is that of its files; where it is not the component's the FMU starts with other values, and these are those
    of another mounting.
    """

    name: str
    component: Component
    values: Parameters
    ends: Mapping[str, Interval]

    @staticmethod
    def of(
        component: str, values: Parameters, ends: Mapping[str, Interval], effects: Sized, ending: str = ""
    ) -> "Start":
        """A component, by its name, with values of its own and with those of the effects that it can have.

        A ValueError for a value beyond what it takes. `ending` is that of its files' name.
        """
        nominal = COMPONENTS[component]
        mine = {place: found for place, found in effects.items() if can_extend(nominal, place)}
        own, possible = dict(values), dict(ends)
        for place, (sizes, intervals) in mine.items():
            for parameter, size, interval in zip(place.definition.parameters, sizes, intervals, strict=True):
                name = parameter_name(place, parameter.name)
                own[name], possible[name] = float(size), interval
        return Start(f"{component}{ending}", started(extend(nominal, list(mine)), own), own, possible)


def takes(
    component: str, values: Mapping[str, float | list[float]], effects: Mapping[EffectPlace, Sequence[float]]
) -> bool:
    """Whether a component takes values of its parameters and of its effects."""
    sized = {place: (own, [(-math.inf, math.inf)] * len(own)) for place, own in effects.items()}
    try:
        Start.of(component, dict(values), {}, sized)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class Extension:
    """Components with what was found of a record, and the scenarios, by their files' names, that give it again."""

    starts: Sequence[Start]
    scenarios: Mapping[str, Scenario]

    def write(self, folder: Path, said: str, flavour: str) -> list[Path]:
        """Write FMUs of a flavour, beside each its values and intervals (.ssv), and the scenarios; all files.

        `said` is what the parameter sets are described by.
        """
        files = [build(s.component, folder, flavour=flavour) for s in self.starts if s.name == s.component.name]
        for start in (start for start in self.starts if start.values):
            path = folder / f"{start.name}.ssv"
            with whole_file(path) as beside:
                beside.write_bytes(parameter_set(start.component, start.values, said, start.ends))
            files.append(path)
        for name, scenario in self.scenarios.items():
            files += write_scenario(scenario, folder / f"{name}.toml")
        return files
