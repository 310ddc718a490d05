"""AttitudeComputer: attitude from angle increments."""

import math

from ..models import attitude
from ..models.attitude_algorithms import ALGORITHMS
from ..models.attitude_algorithms.update import HALF_TABLE_SIZE, STEP_SIZE, TABLE_SIZE, WORK_SIZE
from .component import Component, fixed, input_, output, state, work

ATTITUDE_COMPUTER = Component(
    name="AttitudeComputer",
    description="Strapdown attitude computer: attitude quaternion from angle increments",
    variables=(
        input_(
            "increment",
            "integral of the body's angular rate over the last step",
            3,
            "rad",
            "arcsec",
            variability="discrete",
            within=(-attitude.MAX_INCREMENT, attitude.MAX_INCREMENT),
        ),
        fixed(
            "algorithm",
            "the algorithm: " + "; ".join(f"{a.number} {a.title}, {a.source}" for a in ALGORITHMS),
            start=1.0,
            type="enumeration",
            items=tuple(a.name for a in ALGORITHMS),
        ),
        fixed(
            "sample_period", "time between increments; 0: the length of the first step", unit="s", within=(0.0, None)
        ),
        fixed(
            "initial_attitude",
            "attitude quaternion at the start, scalar first, body to reference",
            4,
            start=(1.0, 0.0, 0.0, 0.0),
            within=(-1.001, 1.001),
        ),
        output("attitude", "attitude quaternion, scalar first, body to reference", 4),
        output(
            "updated",
            "whether the last step brought an update: only then is the attitude that of this moment",
            variability="discrete",
            type="boolean",
        ),
        fixed(
            "renormalise",
            "whether the quaternion is brought back to the unit sphere after every update",
            start=1.0,
            type="boolean",
        ),
        state("start", "time of the start", 1),
        state("period", "time between increments", 1),
        state("samples", "increments taken", 1),
        state("waiting", "increments that wait for an update", 1),
        state("known", "whether there was a step before", 1),
        state("collected", "increments of the step that is not full yet", STEP_SIZE),
        state("previous", "increments of the step before", STEP_SIZE),
        state(
            "samples_of_update",
            "increments that one update of each algorithm takes",
            len(ALGORITHMS),
            start=tuple(float(a.samples) for a in ALGORITHMS),
        ),
        state(
            "longest_increment",
            "longest increment in the valid range of each algorithm",
            len(ALGORITHMS),
            start=tuple(a.max_increment for a in ALGORITHMS),
        ),
        state("table", "what a functional iteration needs", TABLE_SIZE),
        state("half_table", "what a functional iteration through half a window needs", HALF_TABLE_SIZE),
        work("differences", "differences of the increments", WORK_SIZE),
        work("rates", "rates at the nodes of an iteration", WORK_SIZE),
        work("values", "attitude at the nodes of an iteration", WORK_SIZE),
        work("slopes", "derivative of the attitude at the nodes of an iteration", WORK_SIZE),
        work("part", "quaternion of a part of the step", 4),
        work("turned", "quaternion of the step", 4),
        state("before", "the increment before", 3),
        work("added", "what effects add to an increment", 3),
    ),
    model=(attitude.initialise, attitude.step),
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
)
