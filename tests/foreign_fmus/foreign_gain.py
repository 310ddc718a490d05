"""Multiply two inputs, with a parameter of every type; the output follows the inputs at once."""

from pythonfmu import Boolean, Fmi2Causality, Fmi2Slave, Fmi2Variability, Integer, Real, String


class Gain(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.gain, self.times, self.inverted, self.label = 1.0, 1, False, "none"
        self.u, self.count, self.mark, self.word = [0.0, 0.0], 0, False, ""
        fixed = {"causality": Fmi2Causality.parameter, "variability": Fmi2Variability.tunable}
        discrete = {"variability": Fmi2Variability.discrete}
        self.register_variable(Real("gain", **fixed))
        self.register_variable(Integer("times", **fixed))
        self.register_variable(Boolean("inverted", **fixed))
        self.register_variable(String("label", **fixed))
        self.register_variable(Integer("count", causality=Fmi2Causality.input, **discrete))
        self.register_variable(Boolean("mark", causality=Fmi2Causality.input, **discrete))
        self.register_variable(String("word", causality=Fmi2Causality.input, **discrete))
        for i in range(2):
            self._register_pair(i)
        self.register_variable(
            Integer("counted", causality=Fmi2Causality.output, getter=lambda: self.count * self.times, **discrete)
        )
        self.register_variable(
            Boolean("marked", causality=Fmi2Causality.output, getter=lambda: self.mark ^ self.inverted, **discrete)
        )
        self.register_variable(
            String("said", causality=Fmi2Causality.output, getter=lambda: self.label + self.word, **discrete)
        )

    def _register_pair(self, i):
        def set_input(value):
            self.u[i] = value

        def output():
            return self.u[i] * self.gain * self.times * (-1.0 if self.inverted else 1.0)

        self.register_variable(
            Real(f"u[{i + 1}]", causality=Fmi2Causality.input, getter=lambda: self.u[i], setter=set_input)
        )
        self.register_variable(Real(f"y[{i + 1}]", causality=Fmi2Causality.output, getter=output))

    def do_step(self, current_time, step_size):
        return True
