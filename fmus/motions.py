"""Motion of an instrument: TurntableMotion, its commands, and HarmonicMotion.

PositionProgramme, timed rows and TableController command the table; the Euler-Krylov angles of HarmonicMotion are
sums of harmonics.
"""

import math
from collections.abc import Sequence
from typing import Any

from ..models import harmonic_motion, table_commands
from ..models.bench import table
from ..models.bench.table import STAND_SIZE
from ..models.harmonic_motion import HARMONICS
from ..models.random_numbers import GENERATOR_SIZE
from ..models.restricted import CONTEXT_SIZE
from ..models.table_commands import AXIS_PLAN_SIZE, POSITIONS
from . import units
from .component import COUNT, FLAG, GRAVITY, Component, Type, Variable, fixed, input_, output, seed, state, work

ARCSECOND = math.pi / 648000.0

TIMED_ROWS = "TimedRows"
"""Name of the components that `timed_rows` makes."""


def _angle(name: str, description: str) -> Variable:
    return fixed(name, description, 0, "rad", "arcsec", within=(-0.5, 0.5))


def _limits(description: str) -> tuple[Variable, Variable]:
    """The limits of rate and acceleration of both axes."""
    shape: dict[str, Any] = {"size": 2, "start": math.radians(60.0), "within": (1e-9, None)}
    return (
        fixed("max_rate", description.format("rate"), unit="rad/s", display_unit="deg/s", **shape),
        fixed(
            "max_acceleration",
            description.format("angular acceleration"),
            unit="rad/s2",
            display_unit="deg/s2",
            **shape,
        ),
    )


TURNTABLE_MOTION = Component(
    name="TurntableMotion",
    description="Two-axis turntable: commanded positions, geometric errors, encoders, increments and specific force",
    variables=(
        input_("command", "commanded encoder readings of the outer (1) and the inner axis (2)", **units.COMMAND),
        input_("temperature", "temperature of the table", unit="degC", start=20.0),
        _angle("kappa", "κ: dip of the outer axis below the horizon"),
        _angle("epsilon", "ε: lean of the inner axis towards the outer axis"),
        _angle("alpha_offset", "Δα: constant error of the outer encoder, reading less true angle"),
        _angle("beta_offset", "Δβ: constant error of the inner encoder"),
        _angle("alpha_star", "α*: lean of the inner axis across the outer axis"),
        GRAVITY,
        fixed("gravity_error", "Δg/g: model value less true value of gravity, as a fraction", within=(-0.5, 0.5)),
        fixed(
            "encoder_fluctuation_bound",
            "bound of the encoder error that differs from rest to rest",
            0,
            "rad",
            "arcsec",
            start=ARCSECOND,
            within=(0.0, 0.1),
        ),
        fixed(
            "mounting",
            "Q, row by row: block axes from inner-frame axes",
            9,
            start=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
            within=(-1.0, 1.0),
        ),
        fixed(
            "mounting_error",
            "ϑ: rotation vector of the mounting error, in block axes",
            3,
            "rad",
            "arcsec",
            within=(-0.5, 0.5),
        ),
        *_limits("limit of the {} of each axis"),
        fixed("initial_angle", "encoder readings at the start", **units.AXES),
        fixed("earth_rotation", "whether the Earth turns", start=1.0, type="boolean"),
        fixed(
            "latitude",
            "geographic latitude",
            0,
            "rad",
            "deg",
            start=math.radians(55.75),
            within=(-math.pi / 2, math.pi / 2),
        ),
        fixed(
            "azimuth",
            "azimuth of the outer axis, from north towards east",
            0,
            "rad",
            "deg",
            within=(-2 * math.pi, 2 * math.pi),
        ),
        seed("seed of the encoders' fluctuation"),
        output("angle", "true angles: encoder readings less Δα + α* (outer) and Δβ (inner)", **units.AXES),
        output("angle_reading", "readings of the encoders, with their errors", **units.AXES),
        output("rate", "rates of the axes", 2, "rad/s", "deg/s"),
        output("block_rate", "angular rate of the block against the base, in block axes", 3, "rad/s", "deg/s"),
        output(
            "increment",
            "integral of the block's angular rate against inertial space over the last step",
            **units.INCREMENT,
        ),
        output("specific_force", "true specific force in block axes", **units.FORCE),
        output("attitude", "attitude quaternion of the block against the base, scalar first", 4),
        output(
            "attitude_inertial",
            "attitude quaternion of the block against the inertial frame that was the base's at the start",
            4,
        ),
        output("dwell", "number of rests begun", **COUNT),
        output("at_rest", "whether both axes rest", **FLAG),
        state("stand", "what stays as it is over a run", STAND_SIZE),
        state("last_step", "length of the last step"),
        state("plan", "plans of both axes", 2 * AXIS_PLAN_SIZE),
        state("mounting_attitude", "attitude of the block against the inner frame", 4),
        state("generator", "state of the random numbers", GENERATOR_SIZE),
        state("fluctuation", "the encoders' fluctuation as a fraction of its bound", 2),
        state("motion", "angles and rates of the moves", 4),
        state("slipped", "turn of the block on the table that the increments hold so far", 3),
        work("times", "ends of phases", 10),
        work("work", "a quaternion", 4),
        state("context", "the circumstances that effects read", CONTEXT_SIZE),
        work("added", "what effects add", 2),
        work("shifted", "angles, or a rate", 3),
        work("turns", "small turns that effects add", 7),
        work("turn_rates", "rates of those of the table", 4),
    ),
    model=(table.initialise_table, table.step_table),
    next_event=table.next_event,
    exchange=True,
    messages=(
        "mounting is not a proper orthogonal matrix (rows orthonormal to 1e-6, determinant +1)",
        "max_rate and max_acceleration must be positive",
        "command is not a finite angle",
    ),
    equations=(
        "C = exp(ϑ̂) Q R₃(β) R₂(ε) R₁(α) R₂(κ), with α = reading − Δα − α*, β = reading − Δβ",
        "specific force = C (0, 0, g − Δg)",
        "increment = ∫ exp(ϑ̂) Q (β̇ e₃ + R₃(β) R₂(ε) e₁ α̇) + C Ω dt over the step",
    ),
    source="Golovan, Matasov, Tarygin 2022, section 1",
)


def _angles(name: str, axis: str) -> Variable:
    return fixed(
        name,
        f"commanded encoder readings of the {axis} axis, one for each position",
        POSITIONS,
        "rad",
        "deg",
        within=(-1e6, 1e6),
    )


LEAD_STEPS = fixed(
    "lead_steps",
    "0: the outputs after a step are those of this step, for hosts that pass outputs on at once (Trihedron). "
    "1: those of the next step, for hosts that pass them on when all FMUs have stepped (OMSimulator, FMPy)",
    type="integer",
    within=(0.0, 1.0),
)
"""The parameter of every component that knows its outputs beforehand."""


POSITION_PROGRAMME = Component(
    name="PositionProgramme",
    description="Position programme of a two-axis table: commanded positions, each held for its move and its dwell",
    variables=(
        fixed("positions", "how many positions there are", start=1.0, type="integer", within=(1.0, float(POSITIONS))),
        _angles("alpha", "outer"),
        _angles("beta", "inner"),
        fixed(
            "dwell_time", "how long the table rests at each position", POSITIONS, "s", start=20.0, within=(1e-9, None)
        ),
        *_limits("limit of the {} of each axis of the table, to time its moves"),
        fixed("initial_angle", "encoder readings of the table at the start", within=(-1e6, 1e6), **units.AXES),
        fixed(
            "period",
            "slots are rounded up to whole multiples of this time; 0: the length of the first step",
            unit="s",
            within=(0.0, None),
        ),
        LEAD_STEPS,
        output("command", "commanded encoder readings of the outer (1) and the inner axis (2)", **units.COMMAND),
        output("position", "number of the commanded position, from 1", **COUNT),
        output("finished", "whether the last position's dwell is over", **FLAG),
        state("start", "time of the start", 1),
        state("last_step", "length of the last step", 1),
        state("length", "time to whose multiples slots are rounded up; 0: not known yet", 1),
        state("begins", "step at which each slot begins, and the end of the last", POSITIONS + 1),
        work("plan", "a move of each axis", 2 * AXIS_PLAN_SIZE),
    ),
    model=(table_commands.initialise_programme, table_commands.step_programme),
    messages=("a position's move and dwell take more than 1e9 steps",),
    equations=(
        "slot i = ⌈(move from position i − 1 to i + dwell i) / period⌉ periods; "
        "the move is that of the slower axis, with limited rate and acceleration",
        "command = position i over slot i; the last one holds",
    ),
    source="the timing of Trihedron's position programmes",
    step_size=0.1,
    smooth=False,
)


def timed_rows(
    begins: Sequence[float], rows: Sequence[Sequence[float]], period: float, *, unit: str = "1", kind: Type = "real"
) -> Component:
    """A component that gives rows of numbers, each from its time on; they are in the component.

    Parameters
    ----------
    begins : (N,)
        whole steps after the start from which each row holds, growing; the first holds from the start
    rows : (N, K)
        in the unit
    period : float
        length of a step [s]
    unit, kind : str
        of all columns
    """
    values: list[float] = []
    for row in rows:
        values += map(float, row)
    size = (float(len(rows)), float(len(rows[0])))
    return Component(
        name=TIMED_ROWS,
        description=f"Timed rows: {len(rows)} of {len(rows[0])} values, each held from its time on",
        variables=(
            fixed(
                "period", "time in which the times of the rows are counted", unit="s", start=period, within=(1e-9, None)
            ),
            LEAD_STEPS,
            output("value", "the row that holds", len(rows[0]), unit, variability="discrete", type=kind),
            state("size", "rows and columns", 2, start=size),
            state("begins", "periods after the start from which each row holds", len(rows), start=tuple(begins)),
            state("table", "the rows", len(values), start=tuple(values)),
            state("start", "time of the start", 1),
            state("last_step", "length of the last step", 1),
            state("row", "row that holds, from 0", 1),
        ),
        model=(table_commands.initialise_rows, table_commands.step_rows),
        messages=(),
        equations=("value = row i from begins i · period on; the last one holds",),
        source="the timed rows of Trihedron's scenarios",
        step_size=period,
        smooth=False,
    )


TABLE_CONTROLLER = Component(
    name="TableController",
    description="Controller of a two-axis table: feeds the computed attitude back to the commands of both axes",
    variables=(
        input_(
            "attitude", "computed attitude quaternion of the block, scalar first, body to reference", **units.ATTITUDE
        ),
        input_("inner_angle", "angle of the inner axis", 0, "rad", "deg"),
        fixed("initial_attitude", "attitude quaternion that is to be held", **units.ATTITUDE),
        fixed("gain", "k: an error of the attitude is turned back at the rate k times the error", unit="Hz", start=1.0),
        fixed("initial_command", "commands before the first step", **units.AXES),
        output("command", "commanded angles of the outer (1) and the inner axis (2)", **units.COMMAND),
        state("held", "commands so far", 2),
    ),
    model=(table_commands.initialise_controller, table_commands.step_controller),
    messages=("initial_attitude is not a unit quaternion (norm within 1e-3 of 1)", "attitude is zero or not finite"),
    equations=(
        "e = 2 vec(λ̄₀ ∘ λ) / |λ|, the error in body axes; o = (cos β, −sin β, 0), the outer axis in them",
        "command_outer ← command_outer − k h e·o, command_inner ← command_inner − k h e₃ in each step of length h",
    ),
    source="integral control; the frames are those of the two-axis table",
)


def _harmonics(name: str, letter: str, amplitude: float, frequency: float) -> tuple[Variable, ...]:
    """Parameters of one angle; its first harmonic is given, the others are zero."""
    zeros = (0.0,) * (HARMONICS - 1)
    return (
        fixed(
            f"{name}_amplitude",
            f"amplitudes of the harmonics of {letter}",
            HARMONICS,
            "rad",
            "deg",
            start=(amplitude, *zeros),
        ),
        fixed(
            f"{name}_frequency", f"frequencies of the harmonics of {letter}", HARMONICS, "Hz", start=(frequency, *zeros)
        ),
        fixed(f"{name}_phase", f"phases of the harmonics of {letter} at time 0", HARMONICS, "rad", "deg"),
    )


HARMONIC_MOTION = Component(
    name="HarmonicMotion",
    description="Angular motion with harmonic Euler-Krylov angles: increments, specific force and true attitude",
    variables=(
        *_harmonics("psi", "ψ (about the second axis)", math.radians(15.0), 1.0),
        *_harmonics("theta", "ϑ (then about the third axis)", math.radians(5.0), 0.5),
        *_harmonics("gamma", "γ (then about the first axis)", math.radians(15.0), 1.0),
        fixed(
            "pi", "value of π in 2π f t; the paper's program must have had 3.141592", start=math.pi, within=(3.0, 3.3)
        ),
        fixed(
            "trapezoid_nodes",
            "0: increments exact to rounding; M: trapezoid rule with M nodes over `step_samples` increments",
            type="integer",
            within=(0.0, 10001.0),
        ),
        fixed(
            "step_samples",
            "increments over which the nodes of the trapezoid rule are laid",
            start=1.0,
            type="integer",
            within=(1.0, 100.0),
        ),
        fixed(
            "gravity",
            "g: gravity, along the second axis of the reference",
            unit="m/s2",
            start=units.STANDARD_GRAVITY,
            within=(0.0, 100.0),
            nominal=10.0,
        ),
        output("angle", "Euler-Krylov angles ψ, ϑ, γ", 3, "rad", "deg"),
        output("rate", "angular rate in body axes", **units.RATE),
        output("increment", "integral of the angular rate over the last step", **units.INCREMENT),
        output("specific_force", "specific force in body axes", **units.FORCE),
        output("attitude", "true attitude quaternion, scalar first, body to reference", 4),
        state("last_step", "length of the last step", 1),
        state("intervals", "intervals of the trapezoid rule in one increment; 0: exact", 1),
        state("bandwidth", "bound of the circular frequencies in the rates", 1),
        state("harmonics", "amplitude, circular frequency and phase of each harmonic", 9 * HARMONICS),
        work("angle_rate", "rates of the angles", 3),
        work("work", "a quaternion", 4),
    ),
    model=(harmonic_motion.initialise_motion, harmonic_motion.step_motion),
    exchange=True,
    messages=(
        "trapezoid_nodes - 1 is not a multiple of step_samples: the intervals of one increment must be a whole number",
        "the step holds more than 1e6 rad of the motion's phase, or the motion is not finite",
    ),
    equations=(
        "ψ, ϑ, γ = Σ A sin(2π f t + φ)",
        "λ = q₂(ψ) ∘ q₃(ϑ) ∘ q₁(γ)",
        "ω = (γ̇ + ψ̇ sin ϑ, ψ̇ cos ϑ cos γ + ϑ̇ sin γ, ϑ̇ cos γ − ψ̇ cos ϑ sin γ), increment = ∫ ω dt over the step",
        "specific force = λ* ∘ (0, g, 0) ∘ λ",
    ),
    source="Chelnokov, Perelyaev, Chelnokova 2016, section 3",
    step_size=0.001,
    stop_time=600.0,
)
