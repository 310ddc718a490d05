"""An instance of a component in plain Python with access by the names of its variables, arrays whole."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trihedron.fmus import components
from trihedron.fmus.component import Component, extend
from trihedron.fmus.source import Instance, instantiate, references
from trihedron.models.effects import CATALOGUE, EffectPlace, parameter_name

Effects = Mapping[EffectPlace, Sequence[float] | np.ndarray]


class Named:
    """An instance that is not yet initialised.

    Parameters
    ----------
    component : Component or str
        the component
    effects : mapping
        effects composed into it: place -> values of the parameters
    model : Instance
        by default one in plain Python
    values
        values of variables by their names, and of elements of arrays ("bias[2]")
    """

    def __init__(
        self,
        component: Component | str,
        effects: Effects | None = None,
        model: Instance | None = None,
        /,
        **values: ArrayLike,
    ) -> None:
        base = components()[component] if isinstance(component, str) else component
        self.component = extend(base, list(effects or {}))
        self.at = references(self.component)
        self.model = model or instantiate(self.component)
        self.elements = {e: (e,) for e in self.at} | {v.name: v.elements for v in self.component.interface}
        self.put(**values)
        for place, sizes in (effects or {}).items():
            names = [p.name for p in CATALOGUE[place.effect].at(place).parameters]
            self.put(**{parameter_name(place, name): size for name, size in zip(names, sizes, strict=True)})

    def put(self, **values: ArrayLike) -> "Named":
        """Set variables or elements of them."""
        for name, value in values.items():
            for element, number in zip(self.elements[name], np.ravel(value), strict=True):
                self.model.set(self.at[element], float(number))
        return self

    def __getitem__(self, name: str) -> Any:
        """Return a number, or an array (N,)."""
        result = [self.model.get(self.at[element]) for element in self.elements[name]]
        return result[0] if name in self.at else np.array(result)

    def begin(self, time: float = 0.0) -> "Named":
        """Initialise it."""
        assert self.model.initialise(time) == 0
        return self

    def step(self, time: float, length: float) -> "Named":
        """Step over (time, time + length]."""
        assert self.model.do_step(time, length) == 0
        return self

    def refusal(self, message: int) -> str:
        """Return the text of a message of its kernels."""
        assert message > 0
        return self.component.messages[message - 1]

    def refuses_to_begin(self) -> str:
        """Return the reason for which it does not initialise."""
        return self.refusal(self.model.initialise(0.0))

    def refuses_step(self, time: float, length: float) -> str:
        """Return the reason for which it does not step."""
        return self.refusal(self.model.do_step(time, length))

    def outputs(self) -> list[float]:
        """Every output, element by element."""
        text = [e for v in self.component.interface if v.causality == "output" for e in v.elements]
        return [float(self.model.get(self.at[element])) for element in text]
