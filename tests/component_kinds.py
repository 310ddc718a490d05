"""Every component, plain and extended by effects, with random values for its variables."""

import random

from trihedron.fmus import components
from trihedron.fmus.component import Component, Variable, extend
from trihedron.fmus.source import references
from trihedron.models.effects import EffectPlace
from trihedron.models.effects.formula import Formula

GYRO_EFFECTS = [
    EffectPlace(name, "gyro-block")
    for name in (
        "latency",
        "gyro-bias",
        "gyro-bias-drift",
        "gyro-scale-misalignment",
        "gyro-scale-asymmetry",
        "gyro-g-sensitivity",
        "gyro-g-squared",
        "gyro-rate-squared",
        "gyro-rate-cubed",
        "gyro-scale-drift",
        "lag",
        "gyro-bias-step",
        "gyro-scale-step",
        "gyro-warm-up",
        "latency-step",
        "jitter",
    )
] + [Formula.of("w2 += c*w1**3 + d*n1*exp(-time_s)").place]

EXTENDED = {
    "TurntableMotion": [
        EffectPlace("encoder-harmonic", "outer-axis", 2),
        EffectPlace("encoder-harmonic", "inner-axis", 1),
        EffectPlace("axis-wobble", "inner-axis", 2),
        EffectPlace("backlash", "outer-axis"),
        EffectPlace("sag", "inner-axis"),
        EffectPlace("base-drift", "base"),
        EffectPlace("encoder-lag", "inner-axis"),
        Formula.of("beta += c*cos(7*alpha) + d*sense_beta*abs(sin(beta))").place,
        Formula.of("epsilon += c*exp(cos(alpha))").place,
    ],
    "AccelerometerBlock": [
        EffectPlace("quadratic", "accelerometer-3"),
        EffectPlace("bias-drift", "accelerometer-1"),
        EffectPlace("bias-step", "accelerometer-3"),
        EffectPlace("scale-step", "accelerometer-1"),
        EffectPlace("warm-up", "accelerometer-2"),
        EffectPlace("thermal-lag", "accelerometer-1"),
        EffectPlace("bias-wander", "accelerometer-2", law="hours at 0.0 0.0001 0.0003"),
        EffectPlace("scale-asymmetry", "accelerometer-2"),
        EffectPlace("cross-product", "accelerometer-1", axes=(2, 3)),
        EffectPlace("temperature-scale", "accelerometer-2"),
        EffectPlace("hysteresis", "accelerometer-3"),
        EffectPlace("lever-arm", "accelerometer-2"),
        EffectPlace("accelerometer-lag", "accelerometer-3"),
        Formula.of("f1 += a*exp(-hours/2) + b*n1**5/n2 + c*sqrt(abs(n3)) + d*step(hours - 1e-4)*sign(n1)").place,
        Formula.of("f3 += a*sin(3*alpha)*cos(beta) + b*atan2(n1, n2)**-2 + c*sense2*(temperature - 20)").place,
        EffectPlace("dead-zone", "accelerometer-1"),
        EffectPlace("quantisation", "accelerometer-3"),
        EffectPlace("exchanged-readings", "accelerometer-1", axes=(2,)),
    ],
    "AccelerometerCompensation": [],
    "AttitudeComputer": [EffectPlace("undersampling", "attitude-computer")],
    "GyroBlock": [*GYRO_EFFECTS, EffectPlace("gyro-quantisation", "gyro-block")],
    "GyroCompensation": GYRO_EFFECTS,
    "HarmonicMotion": [],
    "PositionProgramme": [],
    "TableController": [],
    "VelocityComputer": [],
}


def all_kinds() -> list[Component]:
    kinds = list(components().values())
    return kinds + [extend(c, EXTENDED[c.name]) for c in kinds if EXTENDED[c.name]]


def title(component: Component) -> str:
    return component.name + (" extended" if component.effects else "")


def draw_parameters(component: Component, rng: random.Random) -> dict[str, float]:
    """Draw random parameters within their limits."""
    values: dict[str, float] = {}
    for v in component.interface:
        if v.causality != "parameter" or v.name in (
            "mounting",
            "initial_attitude",
            "gravity",
            "sample_period",
            "pi",
            "trapezoid_nodes",
            "step_samples",
        ):
            continue
        for element in v.elements:
            if v.type == "boolean":
                values[element] = float(rng.random() < 0.5)
            elif v.type == "enumeration":
                values[element] = float(rng.randint(1, len(v.items)))
            elif v.type == "integer":
                values[element] = float(rng.randint(int(v.within[0] or 0), min(10**9, int(v.within[1] or 10**9))))
            elif v.name in ("max_rate", "max_acceleration"):
                values[element] = rng.uniform(0.2, 3.0)
            elif v.name == "dwell_time":
                values[element] = rng.uniform(0.01, 0.5)
            elif v.name == "period":
                values[element] = rng.choice([0.0, 0.02])
            elif v.name in ("held_fraction", "noise_bound", "quantum"):
                values[element] = rng.uniform(0.0, 0.1)
            elif v.name == "encoder_fluctuation_bound":
                values[element] = rng.uniform(0.0, 1e-5)
            elif v.within[0] == 0.0:
                values[element] = rng.uniform(0.0, 0.01)
            else:
                values[element] = rng.uniform(-0.01, 0.01)
    return values


def draw_inputs(component: Component, rng: random.Random) -> dict[str, float]:
    values: dict[str, float] = {}
    for v in component.interface:
        if v.causality == "input":
            for element in v.elements:
                if v.type == "integer":
                    values[element] = float(rng.randint(1, 3))
                else:
                    # Increments within the valid range of every attitude algorithm.
                    size = 0.02 if v.name == "increment" else 10.0 if v.unit == "m/s2" else 1.0
                    values[element] = rng.uniform(-size, size)
    return values


def elements_of(component: Component, *causalities: str) -> dict[str, Variable]:
    """Return the names of the scalars of a component, of some causalities or of all, with the variable of each."""
    variables: dict[str, Variable] = {}
    for v in component.interface:
        if not causalities or v.causality in causalities:
            variables |= dict.fromkeys(v.elements, v)
    return variables


def setter_of(slave, component: Component):
    """Set values by name, each through the function of its type."""
    kinds = {name: v.type for name, v in elements_of(component).items()}
    numbers = references(component)

    def set_values(values: dict[str, float]) -> None:
        for name, value in values.items():
            if kinds[name] == "real":
                slave.setReal([numbers[name]], [value])
            elif kinds[name] == "boolean":
                slave.setBoolean([numbers[name]], [bool(value)])
            else:
                slave.setInteger([numbers[name]], [int(value)])

    return set_values


def outputs_of(slave, component: Component) -> list[float]:
    numbers = references(component)
    values: list[float] = []
    for v in component.interface:
        if v.causality == "output":
            at = [numbers[e] for e in v.elements]
            get = {"real": slave.getReal, "integer": slave.getInteger, "boolean": slave.getBoolean}[v.type]
            values += [float(x) for x in get(at)]
    return values
