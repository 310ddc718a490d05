"""AttitudeComputer: attitude from angle increments."""

import math

from ..models import attitude
from ..models.attitude_algorithms import ALGORITHMS
from ..models.attitude_algorithms.update import HALF_TABLE_SIZE, STEP_SIZE, TABLE_SIZE, WORK_SIZE
from .component import Component, Variable

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
            "the algorithm: " + "; ".join(f"{a.number} {a.title}, {a.source}" for a in ALGORITHMS),
            "parameter",
            start=1.0,
            variability="fixed",
            type="enumeration",
            items=tuple(a.name for a in ALGORITHMS),
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
        Variable(
            "renormalise",
            "whether the quaternion is brought back to the unit sphere after every update",
            "parameter",
            start=1.0,
            variability="fixed",
            type="boolean",
        ),
        Variable("start", "time of the start", size=1),
        Variable("period", "time between increments", size=1),
        Variable("samples", "increments taken", size=1),
        Variable("waiting", "increments that wait for an update", size=1),
        Variable("known", "whether there was a step before", size=1),
        Variable("collected", "increments of the step that is not full yet", size=STEP_SIZE),
        Variable("previous", "increments of the step before", size=STEP_SIZE),
        Variable(
            "samples_of_update",
            "increments that one update of each algorithm takes",
            size=len(ALGORITHMS),
            start=tuple(float(a.samples) for a in ALGORITHMS),
        ),
        Variable(
            "longest_increment",
            "longest increment in the valid range of each algorithm",
            size=len(ALGORITHMS),
            start=tuple(a.max_increment for a in ALGORITHMS),
        ),
        Variable("table", "what a functional iteration needs", size=TABLE_SIZE),
        Variable("half_table", "what a functional iteration through half a window needs", size=HALF_TABLE_SIZE),
        Variable("differences", "differences of the increments", "work", WORK_SIZE),
        Variable("rates", "rates at the nodes of an iteration", "work", WORK_SIZE),
        Variable("values", "attitude at the nodes of an iteration", "work", WORK_SIZE),
        Variable("slopes", "derivative of the attitude at the nodes of an iteration", "work", WORK_SIZE),
        Variable("part", "quaternion of a part of the step", "work", 4),
        Variable("turned", "quaternion of the step", "work", 4),
        Variable("before", "the increment before", size=3),
        Variable("added", "what effects add to an increment", "work", 3),
    ),
    initialise=attitude.initialise,
    step=attitude.step,
    respond=None,
    messages=(
        "initial_attitude is not a unit quaternion (norm within 1e-3 of 1)",
        "the communication step is not the sample period: one increment for each sample is needed",
        f"increment is not finite or longer than half a turn ({math.pi:.6f} rad): its direction would be ambiguous",
        "increment is beyond the valid range of the algorithm; longest [rad]: "
        + ", ".join(f"{a.name} {a.max_increment:.3g}" for a in ALGORITHMS),
        "the increments are not those of a smooth rate: the functional iteration does not end",
    ),
    equations=(
        "λ(tₙ) = λ(tₙ₋₁) ∘ λ*, λ* = ((1 − x·x), 2x) / (1 + x·x), x = tan(φ/4) e",
        "(22): x = (1/4 + γ'·γ'/48) γ' + (1/4 + γ''·γ''/48) γ'' + (γ' × γ'')/6",
        "(25): λ* = (cos(φ/2), φ sin(φ/2)/|φ|), φ = Σ γ + coning correction; (7.18): φ = γ",
    ),
    source="Chelnokov, Perelyaev, Chelnokova 2016",
    step_size=0.01,
    stop_time=60.0,
)
