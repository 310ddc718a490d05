"""PositionProgramme: the commands of a two-axis table, so that it moves in a tool that has nothing of ours."""

import math

from ..models import position_programme
from ..models.motion import AXIS_PLAN_SIZE
from ..models.position_programme import POSITIONS
from .component import Component, Variable


def _angles(name: str, axis: str) -> Variable:
    return Variable(
        name,
        f"commanded encoder readings of the {axis} axis, one for each position",
        "parameter",
        POSITIONS,
        "rad",
        "deg",
        variability="fixed",
        minimum=-1e6,
        maximum=1e6,
    )


def _limits(name: str, what: str, unit: str, shown: str) -> Variable:
    return Variable(
        name,
        f"limit of the {what} of each axis of the table, to time its moves",
        "parameter",
        2,
        unit,
        shown,
        start=math.radians(60.0),
        variability="fixed",
        minimum=1e-9,
    )


POSITION_PROGRAMME = Component(
    name="PositionProgramme",
    description="Position programme of a two-axis table: commanded positions, each held for its move and its dwell",
    variables=(
        Variable(
            "positions",
            "how many positions there are",
            "parameter",
            start=1.0,
            variability="fixed",
            type="integer",
            minimum=1.0,
            maximum=float(POSITIONS),
        ),
        _angles("alpha", "outer"),
        _angles("beta", "inner"),
        Variable(
            "dwell_time",
            "how long the table rests at each position",
            "parameter",
            POSITIONS,
            "s",
            start=20.0,
            variability="fixed",
            minimum=1e-9,
        ),
        _limits("max_rate", "rate", "rad/s", "deg/s"),
        _limits("max_acceleration", "angular acceleration", "rad/s2", "deg/s2"),
        Variable(
            "initial_angle",
            "encoder readings of the table at the start",
            "parameter",
            2,
            "rad",
            "deg",
            variability="fixed",
            minimum=-1e6,
            maximum=1e6,
        ),
        Variable(
            "period",
            "slots are rounded up to whole multiples of this time; 0: the length of the first step",
            "parameter",
            unit="s",
            variability="fixed",
            minimum=0.0,
        ),
        Variable(
            "lead_steps",
            "0: after a step the command is that of this step, for hosts that pass outputs on at once (Trihedron); "
            "1: that of the next step, for hosts that pass them on when all FMUs have stepped (OMSimulator, FMPy)",
            "parameter",
            variability="fixed",
            type="integer",
            minimum=0.0,
            maximum=1.0,
        ),
        Variable(
            "command",
            "commanded encoder readings of the outer (1) and the inner axis (2)",
            "output",
            2,
            "rad",
            "deg",
            variability="discrete",
        ),
        Variable(
            "position", "number of the commanded position, from 1", "output", variability="discrete", type="integer"
        ),
        Variable(
            "finished",
            "whether the last position's dwell is over",
            "output",
            variability="discrete",
            type="boolean",
        ),
        Variable("start", "time of the start", size=1),
        Variable("last_step", "length of the last step", size=1),
        Variable("length", "time to whose multiples slots are rounded up; 0: not known yet", size=1),
        Variable("begins", "step at which each slot begins, and the end of the last", size=POSITIONS + 1),
        Variable("plan", "a move of each axis", "work", 2 * AXIS_PLAN_SIZE),
    ),
    initialise=position_programme.initialise,
    step=position_programme.step,
    respond=None,
    messages=("a position's move and dwell take more than 1e9 steps",),
    equations=(
        "slot i = ⌈(move from position i − 1 to i + dwell i) / period⌉ periods; "
        "the move is that of the slower axis, with limited rate and acceleration",
        "command = position i over slot i; the last one holds",
    ),
    source="the timing of Trihedron's position programmes",
    step_size=0.1,
    stop_time=60.0,
)
