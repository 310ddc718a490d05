"""Put out the received times: the communication point of the last step, the step, the number of steps."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real


class Clock(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.began = self.step = self.ended = 0.0
        self.start = self.stop = -1.0
        self.count = 0
        for name in ("began", "step", "ended", "start", "stop"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))
        self.register_variable(Integer("count", causality=Fmi2Causality.output, variability=Fmi2Variability.discrete))

    def setup_experiment(self, start_time, stop_time, tolerance):
        self.start, self.stop = start_time, stop_time

    def do_step(self, current_time, step_size):
        self.began, self.step, self.ended = current_time, step_size, current_time + step_size
        self.count += 1
        return True
