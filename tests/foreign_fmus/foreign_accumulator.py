"""Add up the input, step by step; keep its value at the end of the initialisation."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Accumulator(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.increment, self.total, self.at_first = 0.0, 0.0, 0.0
        self.register_variable(Real("increment", causality=Fmi2Causality.input))
        self.register_variable(Real("total", causality=Fmi2Causality.output))
        self.register_variable(Real("at_first", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.at_first = self.increment

    def do_step(self, current_time, step_size):
        self.total += self.increment
        return True
