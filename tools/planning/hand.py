"""Plan how to move an instrument by hand: which poses and turns, how long, for a wanted error.

Accelerometers are known by |f| = g at rests (`motion.determinacy`), gyros by moves between rests, which must turn the
direction of gravity as it was measured at both ends. A greedy search takes the pose and turn that lessen the worst
error most; after each the errors are predicted again.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ..errors import InputError, nearest
from ..motion.determinacy import LEAST_SD, MOST_POSES, TURN_PRIOR_SD, Determinacy, candidate_poses, worst_turn
from ..motion.inspect import inspect_record
from ..motion.norm import NAMES, norm_equations, standard_deviations
from ..motion.trust import trusted
from ..noise import Noise
from ..quantity import Quantity
from ..records import BenchRecord, StrapdownRecord, read_record
from ..result import Result
from ..rounding import digits, exactly

if TYPE_CHECKING:
    from polars import DataFrame

OF_GYROS = tuple(f"M{row}{column}" for row in (1, 2, 3) for column in (1, 2, 3))
MOVE_SD = 2e-3
"""A move's own error [rad]: how the gyros' bias wanders, and what lies between samples."""
MOVE_S = 3.0
"""Time from one rest to the next [s]."""
SHORTEST_REST_S, LONGEST_REST_S = 3.0, 20.0
FACES = ("axis 1 up", "axis 2 up", "axis 3 up", "axis 1 down", "axis 2 down", "axis 3 down")
"""Poses that a box on a table takes, in an order of turns of 90° about all axes."""
UNITS = {"mg": 1e-3, "ug": 1e-6, "g": 1.0, "%": 1e-2, "ppm": 1e-6, "mrad": 1e-3, "arcmin": np.pi / 10800.0, "": 1.0}
"""Units of wanted errors, in g, 1 and rad."""
USED = 1e-3
"""A step that lessens the worst error by a smaller part is of no use."""


@dataclass(frozen=True)
class HandPlanRequest:
    """Request for a calibration by hand: accuracies and properties of the instrument.

    Attributes
    ----------
    accuracy : str
        standard error of |f| at rest in the worst pose, as 1mg
    turn_accuracy : str or None
        standard error of a turn of 90° about the worst axis, as 10arcmin; None: the gyros do not matter
    targets : sequence of str
        standard errors of parameters, as gamma_21=5e-4 or bias_1=0.5mg
    noise_density : float
        of the accelerometers [m/s²/√Hz]
    measured : path or None
        a strapdown record whose rests count
    trust : bool
        the record counts although it looks wrong
    """

    accuracy: str = "1mg"
    turn_accuracy: str | None = None
    targets: Sequence[str] = ()
    noise_density: float = 4e-3
    measured: str | Path | None = None
    trust: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.noise_density < 1.0:
            raise InputError(
                f"--noise-density {exactly(self.noise_density)}: must be in m/s2/√Hz, from 0 to 1, as 4e-3"
            )

    @cached_property
    def worst_error(self) -> float:
        """Return the wanted error of |f| [g]."""
        return wanted_error(self.accuracy, "--accuracy", "1mg")

    @cached_property
    def turn_error(self) -> float | None:
        """Return the wanted error of a turn of 90° [rad]; None where there is none."""
        if self.turn_accuracy is None:
            return None
        return wanted_error(self.turn_accuracy, "--turn-accuracy", "10arcmin")

    @cached_property
    def errors(self) -> Mapping[str, float]:
        """Return the wanted errors of parameters by their symbols."""
        wanted = {}
        for text in self.targets:
            symbol, equals, size = text.partition("=")
            if symbol not in (*NAMES, *OF_GYROS):
                raise InputError(f"--target {text}: is not known; {nearest(symbol, [*NAMES, *OF_GYROS])}")
            if not equals:
                raise InputError(f"--target {text}: must say the wanted standard error, as {symbol}=5e-4")
            wanted[symbol] = wanted_error(size, f"--target {symbol}=", "5e-4")
        return wanted

    @property
    def rest_s(self) -> float:
        """Return the length of a rest [s]: the noise of its mean is then half of its other errors."""
        needed = (2.0 * self.noise_density / STANDARD_GRAVITY / LEAST_SD) ** 2
        return float(np.ceil(np.clip(needed, SHORTEST_REST_S, LONGEST_REST_S)))

    @property
    def rest_sd(self) -> float:
        """Return the standard deviation of a mean at rest [g]."""
        return float(np.hypot(self.noise_density / STANDARD_GRAVITY / np.sqrt(self.rest_s), LEAST_SD))


def density_of(noise: Noise) -> float:
    """Return the largest noise density of the accelerometers [m/s²/√Hz]; an InputError where the file has none."""
    densities = []
    for channel in noise.of("accelerometer"):
        white = channel.coefficient("N")
        if white is not None:
            densities.append(white.high if white.estimate is None else white.estimate)
    if not densities or None in densities:
        raise InputError("--noise: tells no noise density of the accelerometers; give --noise-density")
    return max(densities)


def wanted_error(text: str, option: str, example: str) -> float:
    """Return a wanted error in g, 1 or rad; an InputError for anything else."""
    match = re.fullmatch(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*([a-z%]*)\s*", text)
    unit = match[2] if match else ""
    try:
        value = float(match[1]) * UNITS[unit] if match else np.nan
    except (KeyError, ValueError):
        value = np.nan
    if not 0.0 < value < np.inf:
        units = ", ".join(unit for unit in UNITS if unit)
        raise InputError(f"{option} {text!r}: must be a positive number, alone or of {units}: {example}")
    return value


@dataclass(frozen=True)
class TurnDeterminacy:
    """How well moves determine the scale factors and misalignments M of gyros, row by row: covariance (9, 9)."""

    covariance: Floats = field(default_factory=lambda: np.diag(TURN_PRIOR_SD**2))

    @property
    def worst(self) -> float:
        """The largest standard error of a turn of 90° [rad], over all axes."""
        return worst_turn(self.covariance)[0]

    def with_turn(self, turn: "PlannedTurn", sd: float) -> Self:
        """Return the determinacy after a turn between two rests, whose directions err by `sd` [rad] each."""
        rows = _cross(turn.after) @ _along_the_way(turn) @ np.kron(np.eye(3), turn.axis[None, :])
        noise = (MOVE_SD**2 + 2.0 * sd**2) * np.eye(3)
        gain = np.linalg.solve(rows @ self.covariance @ rows.T + noise, rows @ self.covariance)
        return type(self)(self.covariance - self.covariance @ rows.T @ gain)


@dataclass(frozen=True)
class PlannedTurn:
    """A turn by `angle` [rad] about `axis` (3,), both axes of the instrument; `after` (3,) is the direction up then."""

    axis: Floats
    angle: float
    after: Floats
    words: str


def _cross(vector: NDArray) -> Floats:
    """Return the matrix (3, 3) of the product with a vector from the left."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def _along_the_way(turn: PlannedTurn) -> Floats:
    """Return the integral (3, 3) over a turn that carries an error per angle to its end."""
    axis, angle = turn.axis, turn.angle
    along = np.outer(axis, axis)
    return angle * along + np.sin(angle) * (np.eye(3) - along) - (1.0 - np.cos(angle)) * _cross(axis)


def turns_to(up: NDArray, target: NDArray) -> list[PlannedTurn]:
    """Return the turns that bring the direction up (3,) to another one: the shortest.

    From a direction to itself it is a half turn about the vertical; to the opposite one there is a turn about each axis
    of the instrument that is level.
    """
    cosine = float(np.clip(up @ target, -1.0, 1.0))
    if cosine > 1.0 - 1e-9:
        return [PlannedTurn(up, np.pi, target, "turn by 180° about the vertical")]
    if cosine > -1.0 + 1e-9:
        axis = np.cross(target, up)
        angle = float(np.arccos(cosine))
        degrees = digits(np.degrees(angle), 3).removesuffix(".0")
        words = f"turn by {degrees}°, the shortest way"
        return [PlannedTurn(axis / np.linalg.norm(axis), angle, target, words)]
    turns = []
    for number, axis in enumerate(np.eye(3), start=1):
        if abs(axis @ up) < 1e-9:
            turns.append(PlannedTurn(axis, np.pi, target, f"turn by 180° about axis {number}"))
    return turns or [PlannedTurn(_level(up), np.pi, target, "turn over by 180°")]


def _level(up: NDArray) -> Floats:
    """Return a unit vector (3,) at right angles to another."""
    axis = np.cross(up, np.eye(3)[int(np.abs(up).argmin())])
    return axis / np.linalg.norm(axis)


class HandStep(Result):
    """A step of a plan: a turn to a pose, and a rest there.

    Attributes
    ----------
    turn : str
        how to get there from the pose before; "" for the first
    pose : str
    up : list of float
        direction up in the instrument's axes
    rest_s : float
    pose_error : float
        predicted standard error of |f| in the worst pose after it [g]
    turn_error : float
        predicted standard error of a turn of 90° about the worst axis after it [rad]
    """

    turn: str
    pose: str
    up: list[float]
    rest_s: float
    pose_error: float = Field(alias="pose_error_g")
    turn_error: float = Field(alias="turn_error_rad")


class ParameterPlanned(Result):
    """Predicted standard error of a parameter after a plan, and the wanted one."""

    symbol: Annotated[str, Quantity("parameter")]
    unit: Annotated[str, Quantity("unit")]
    standard_error: Annotated[float, Quantity("standard error", "", "nearest", 2)]
    wanted: Annotated[float | None, Quantity("wanted", "", "nearest", 2)] = None


class HandPlan(Result):
    """A plan to move an instrument by hand.

    Attributes
    ----------
    steps : list of HandStep
    minutes : float
    rest_sd_g : float
        standard deviation of a mean at rest
    measured : str
        the record whose rests count, too
    pose_error, turn_error : float
        predicted standard errors after all steps: of |f| in the worst pose [g], of a turn of 90° [rad]
    parameters : list of ParameterPlanned
    warnings : list of str
        unusual facts about that record
    """

    omitted: ClassVar[frozenset[str]] = frozenset({"warnings"})

    schema_: Literal["trihedron.hand-plan/1"] = Field(default="trihedron.hand-plan/1", alias="schema")
    steps: list[HandStep]
    minutes: float
    rest_sd: float = Field(alias="rest_sd_g")
    measured: str
    pose_error: float = Field(alias="pose_error_g")
    turn_error: float = Field(alias="turn_error_rad")
    parameters: list[ParameterPlanned]
    warnings: list[str] = Field(default=[])

    def to_polars(self) -> "DataFrame":
        """A row for each step."""
        import polars as pl

        rows: list[dict[str, Any]] = []
        for step in self.steps:
            row = step.to_json()
            rows.append({key: value for key, value in row.items() if key != "up"})
        return pl.DataFrame(rows)


@dataclass(frozen=True)
class Progress:
    """Knowledge at a point of a plan: accelerometers, gyros, and the pose (3,) of the instrument, if any."""

    forces: Determinacy
    gyros: TurnDeterminacy
    up: Floats | None = None

    def moved(self, turn: PlannedTurn | None, up: NDArray, sd: float) -> "Progress":
        """Return the knowledge after a turn and a rest."""
        gyros = self.gyros if turn is None else self.gyros.with_turn(turn, sd)
        return Progress(self.forces.with_pose(up, sd), gyros, up)

    def lack(self, request: HandPlanRequest) -> float:
        """Return the largest ratio of a predicted error to the wanted one."""
        ratios = [self.forces.worst / request.worst_error]
        if request.turn_error is not None:
            ratios.append(self.gyros.worst / request.turn_error)
        errors = self.standard_errors
        ratios += [errors[symbol] / wanted for symbol, wanted in request.errors.items()]
        return max(ratios)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Return the standard errors of all parameters by their symbols."""
        of_gyros = np.sqrt(np.diag(self.gyros.covariance))
        values = [*self.forces.standard_errors.tolist(), *of_gyros.tolist()]
        return dict(zip((*NAMES, *OF_GYROS), values, strict=True))


def plan_by_hand(request: HandPlanRequest) -> HandPlan:
    """Return the poses and turns that bring every wanted error about.

    Raises
    ------
    InputError
        for a wanted error that cannot be reached, or a record that cannot be used
    """
    known, name, warnings = _measured(request)
    wanted_of_gyros = request.turn_error is not None or any(symbol in OF_GYROS for symbol in request.errors)
    sd, poses = request.rest_sd, candidate_poses()
    steps: list[HandStep] = []
    faces = list(FACES)
    lacks = [known.lack(request)]
    while lacks[-1] > 1.0:
        words = faces.pop(0) if faces and not name else None
        trials = []
        for pose, up in poses.items():
            if words in (None, pose):
                trials += _trials(known, pose, up, sd)
        trial = min(trials, key=lambda trial: trial[0].lack(request))
        known = trial[0]
        lacks.append(known.lack(request))
        stuck = len(lacks) > 3 and not faces and lacks[-1] > (1.0 - USED) * lacks[-4]
        if len(steps) >= 3 * MOST_POSES or stuck:
            raise InputError(_out_of_reach(request, known, len(steps)))
        steps.append(_step(trial, request.rest_s))
    errors = known.standard_errors
    shown = errors if wanted_of_gyros else {symbol: errors[symbol] for symbol in NAMES}
    parameters = []
    for symbol, error in shown.items():
        unit = "g" if symbol.startswith("bias") else "1"
        wanted = request.errors.get(symbol)
        parameters.append(ParameterPlanned(symbol=symbol, unit=unit, standard_error=error, wanted=wanted))
    return HandPlan(
        steps=steps,
        minutes=(len(steps) * (request.rest_s + MOVE_S)) / 60.0,
        rest_sd_g=sd,
        measured=name,
        pose_error_g=known.forces.worst,
        turn_error_rad=known.gyros.worst,
        parameters=parameters,
        warnings=warnings,
    )


def _trials(known: Progress, pose: str, up: NDArray, sd: float) -> list[tuple[Progress, str, str]]:
    """Return the knowledge after each way to a pose, with the words of turn and pose."""
    if known.up is None:
        return [(known.moved(None, up, sd), "", pose)]
    trials = []
    for turn in turns_to(known.up, up):
        trials.append((known.moved(turn, up, sd), turn.words, pose))
    return trials


def _step(trial: tuple[Progress, str, str], rest_s: float) -> HandStep:
    """Return the step of a plan that a trial is."""
    known, turn, pose = trial
    assert known.up is not None
    return HandStep(
        turn=turn,
        pose=pose,
        up=known.up.tolist(),
        rest_s=rest_s,
        pose_error_g=known.forces.worst,
        turn_error_rad=known.gyros.worst,
    )


def _out_of_reach(request: HandPlanRequest, known: Progress, count: int) -> str:
    """Return what to ask for instead of what cannot be reached."""
    reached = [f"--accuracy {digits(1e3 * known.forces.worst, 2)}mg"]
    if request.turn_error is not None:
        reached.append(f"--turn-accuracy {digits(known.gyros.worst / UNITS['arcmin'], 2)}arcmin")
    errors = known.standard_errors
    reached += [f"--target {symbol}={digits(errors[symbol], 2)}" for symbol in request.errors]
    return (
        f"the wanted errors are out of reach by hand: {count} rests reach {', '.join(reached)}; a mean at rest errs by "
        f"{digits(1e3 * request.rest_sd, 2)} mg whatever its length, a move by {digits(MOVE_SD / UNITS['arcmin'], 2)} "
        "arcmin"
    )


def _measured(request: HandPlanRequest) -> tuple[Progress, str, list[str]]:
    """Return the knowledge from the rests of a record, its name and warnings; of the moves the shortest turns."""
    known = Progress(Determinacy.before(), TurnDeterminacy())
    if request.measured is None:
        return known, "", []
    record = trusted(read_record(request.measured, StrapdownRecord, BenchRecord), trust=request.trust)
    name, warnings = record.path.name, list(record.warnings)
    rests = inspect_record(record.gyros if isinstance(record, BenchRecord) else record).rests
    if not len(rests):
        return known, name, warnings
    force = rests.force / STANDARD_GRAVITY
    sd: NDArray | float = request.rest_sd
    if rests.force_scatter is not None:
        sd = standard_deviations(rests.force_scatter / STANDARD_GRAVITY)
    forces = Determinacy.of(norm_equations(np.zeros(9), force)[1], sd)
    gyros = TurnDeterminacy()
    directions = force / np.linalg.norm(force, axis=1, keepdims=True)
    for before, after in pairwise(directions):
        turn = turns_to(before, after)[0]
        if turn.angle < np.pi:
            gyros = gyros.with_turn(turn, request.rest_sd)
    return Progress(forces, gyros), name, warnings
