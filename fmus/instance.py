"""A running component. The same text runs inside the PythonFMU FMU, so it imports nothing of Trihedron."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence


class Instance:
    """The memory of a component and the order in which its kernels may be called.

    Parameters
    ----------
    variables : sequence of tuple
        (name, causality, size, start values, variability, message's lower and upper limit or None) of each variable
    kernels : dict
        "initialise", "step" and, where outputs follow inputs at once, "respond"
    arguments : dict
        kernel's name -> names of its arguments
    effect_count : int
        how many of the last variables are parameters of effects
    """

    def __init__(
        self,
        variables: Sequence[tuple],
        kernels: dict[str, Callable[..., int | None]],
        arguments: Mapping[str, Sequence[str]],
        effect_count: int,
    ) -> None:
        self.kernels = kernels
        self.arguments = arguments
        own = variables[: len(variables) - effect_count]
        self.memory: dict[str, list[float]] = {name: list(starts) for name, _, _, starts, _, _, _ in own}
        self.memory["effect"] = [row[3][0] for row in variables[len(own) :]]
        self.scalars = {row[0] for row in own if row[2] == 0 and row[1] in ("parameter", "input")}
        # Of each scalar that the world sees, in the order of the value references from 1 on.
        self.cells: list[tuple[list[float], int]] = []
        self.rules: list[tuple[str, str, str, float | None, float | None]] = []
        for name, causality, _, starts, variability, lower, upper in own:
            if causality in ("parameter", "input", "output"):
                for i in range(len(starts)):
                    self.cells.append((self.memory[name], i))
                    self.rules.append((name, causality, variability, lower, upper))
        for i, row in enumerate(variables[len(own) :]):
            self.cells.append((self.memory["effect"], i))
            self.rules.append((row[0], row[1], row[4], row[5], row[6]))
        self.time = 0.0
        self.phase = "instantiated"
        self.stale = False

    def call(self, kernel: str, step: float) -> int:
        """Run a kernel on the memory; returns 0 or the number of its message."""
        values: list[object] = []
        for name in self.arguments[kernel]:
            if name == "time":
                values.append(self.time)
            elif name == "step":
                values.append(step)
            elif name in self.scalars:
                values.append(self.memory[name][0])
            else:
                values.append(self.memory[name])
        return self.kernels[kernel](*values) or 0

    def get(self, reference: int) -> float:
        """Value of a scalar by its value reference (0 is the time)."""
        if reference == 0:
            return self.time
        if self.phase == "instantiated" and self.rules[reference - 1][1] == "output":
            return self.preview(reference)
        if self.stale:
            self.respond()
        values, i = self.cells[reference - 1]
        return values[i]

    def preview(self, reference: int) -> float:
        """What an output would be if the initialisation ended now; ValueError when it cannot."""
        kept = self.get_state()
        try:
            if self.initialise(self.time):
                raise ValueError("the parameters are not ones to begin with: there are no outputs yet")
            return float(self.get(reference))
        finally:
            self.set_state(kept)

    def set(self, reference: int, value: float) -> None:
        """Set a parameter or an input; ValueError says why it is refused."""
        name, causality, variability, lower, upper = self.rules[reference - 1] if reference else ("time", "", "", 0, 0)
        if causality not in ("parameter", "input"):
            raise ValueError(f"{name} cannot be set: it is neither a parameter nor an input")
        if causality == "parameter" and variability == "fixed" and self.phase == "stepping":
            raise ValueError(f"{name} is fixed: it cannot be set after initialisation")
        if causality == "parameter":
            if not value - value == 0.0:
                raise ValueError(f"{name} = {value!r} is not a finite number")
            if (lower is not None and value < lower) or (upper is not None and value > upper):
                raise ValueError(f"{name} = {value!r} is outside [{lower}, {upper}]")
        values, i = self.cells[reference - 1]
        values[i] = float(value)
        self.stale = "respond" in self.kernels and self.phase == "stepping"

    def respond(self) -> None:
        """Bring the outputs that follow the inputs at once up to date."""
        self.stale = False
        if "respond" in self.kernels:
            self.call("respond", 0.0)

    def initialise(self, time: float) -> int:
        """End the initialisation at `time`; returns 0 or the number of a message."""
        self.time = time
        message = self.call("initialise", 0.0)
        if message == 0:
            self.phase = "stepping"
            self.respond()
        return message

    def do_step(self, time: float, step: float) -> int:
        """Step over (time, time + step]; returns 0 or the number of a message."""
        self.time = time
        message = self.call("step", step)
        self.time = time + step
        self.respond()
        return message

    def get_state(self) -> dict:
        """Everything that decides what comes next."""
        return {
            "memory": {name: list(values) for name, values in self.memory.items()},
            "time": self.time,
            "phase": self.phase,
            "stale": self.stale,
        }

    def set_state(self, state: dict) -> None:
        """Go back to a state of `get_state`; ValueError when it is not one of this component."""
        memory = state.get("memory", {})
        if {n: len(v) for n, v in memory.items()} != {n: len(v) for n, v in self.memory.items()}:
            raise ValueError("the state is not one of this component")
        for name, values in memory.items():
            self.memory[name][:] = values
        self.time, self.phase, self.stale = state["time"], state["phase"], state["stale"]
