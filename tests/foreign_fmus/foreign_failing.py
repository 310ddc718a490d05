"""Fail on demand, in each of the ways in which an FMU can."""

import math

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real
from pythonfmu.enums import Fmi2Status

WAYS = {"error": 1, "raises": 2, "nan": 3, "infinity": 4, "format": 5, "initialisation": 6, "silent": 7, "exits": 8}


class Failing(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.way, self.after, self.y = 0, 0.25, 0.0
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        self.register_variable(Integer("way", **fixed))
        self.register_variable(Real("after", **fixed))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        if self.way == WAYS["initialisation"]:
            raise ValueError("the seal is broken")

    def do_step(self, current_time, step_size):
        if current_time < self.after:
            return True
        if self.way == WAYS["error"]:
            self.log("the pump has stopped, 100% of it", Fmi2Status.error)
            return False
        if self.way == WAYS["silent"]:
            return False
        if self.way == WAYS["exits"]:
            raise SystemExit(3)
        if self.way == WAYS["raises"]:
            raise ZeroDivisionError("the gear ratio is zero")
        if self.way == WAYS["format"]:
            raise ValueError("%s%s%n of %d")
        self.y = {WAYS["nan"]: math.nan, WAYS["infinity"]: -math.inf}.get(self.way, current_time)
        return True
