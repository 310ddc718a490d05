"""AttitudeComputer: attitude from angle increments."""

import math

from trihedron.fmus.component import Component, Variable
from trihedron.models import attitude

ATTITUDE_COMPUTER = Component(
    name="AttitudeComputer",
    description="Strapdown attitude computer: attitude quaternion from angle increments",
    variables=(
        Variable(
            "increment",
            "integral of the body's angular rate over the last step",
            "input",
            3,
            "rad",
            "arcsec",
            variability="discrete",
            minimum=-attitude.MAX_INCREMENT,
            maximum=attitude.MAX_INCREMENT,
        ),
        Variable(
            "algorithm",
            "the algorithm: " + "; ".join(f"{a.number} {a.title}, {a.source}" for a in attitude.ALGORITHMS),
            "parameter",
            start=1.0,
            variability="fixed",
            type="enumeration",
            items=tuple(a.name for a in attitude.ALGORITHMS),
        ),
        Variable(
            "sample_period",
            "time between increments; 0: the length of the first step",
            "parameter",
            unit="s",
            variability="fixed",
            minimum=0.0,
        ),
        Variable(
            "initial_attitude",
            "attitude quaternion at the start, scalar first, body to reference",
            "parameter",
            4,
            start=(1.0, 0.0, 0.0, 0.0),
            variability="fixed",
            minimum=-1.001,
            maximum=1.001,
        ),
        Variable("attitude", "attitude quaternion, scalar first, body to reference", "output", 4),
        Variable(
            "updated",
            "whether the last step brought an update: only then is the attitude that of this moment",
            "output",
            variability="discrete",
            type="boolean",
        ),
        Variable("start", "time of the start", size=1),
        Variable("period", "time between increments", size=1),
        Variable("samples", "increments taken", size=1),
        Variable("collected", "increments that wait for an update", size=3),
        Variable("x", "tan(φ/4) e of the step", "work", 3),
        Variable("turned", "quaternion of the step", "work", 4),
    ),
    initialise=attitude.initialise,
    step=attitude.step,
    respond=None,
    messages=(
        "initial_attitude is not a unit quaternion (norm within 1e-3 of 1)",
        "the communication step is not the sample period: one increment for each sample is needed",
        f"increment is not finite or longer than half a turn ({math.pi:.6f} rad): its direction would be ambiguous",
    ),
    equations=(
        "λ(tₙ) = λ(tₙ₋₁) ∘ λ*, λ* = ((1 − x·x), 2x) / (1 + x·x), x = tan(φ/4) e",
        "(22): x = (1/4 + γ'·γ'/48) γ' + (1/4 + γ''·γ''/48) γ'' + (γ' × γ'')/6",
        "(7.18): λ* = (cos(|γ|/2), γ sin(|γ|/2)/|γ|)",
    ),
    source="Chelnokov, Perelyaev, Chelnokova 2016",
    step_size=0.01,
    stop_time=60.0,
)
