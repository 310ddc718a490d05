"""Return the parameter; above 1, end the process; below -1, fail."""

import os

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Deadly(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.level = 0.0
        self.y = 0.0
        self.register_variable(Real("level", causality=Fmi2Causality.parameter, variability=Fmi2Variability.fixed))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        if self.level > 1.0:
            os._exit(9)
        if self.level < -1.0:
            raise RuntimeError("level too low")
        self.y = self.level + step_size
        return True
