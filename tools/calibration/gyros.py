"""Calibration of a whole IMU by a bench record: gyros in the accelerometers' axes, and a bench that both have seen.

The accelerometers at rest are calibrated first, by themselves. Their readings and the gyros' integrals over turns then
make one system, whose linear programmes give every target again. The joint result is never wider than the first.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from ...fmus.units import ARCMIN
from ...models.arrays import Floats
from ...models.bench import GYRO_PARAMETERS, TARGETS, earth_in_base
from .. import motion
from ..bounded.programmes import SolverError
from ..calibrated import Calibration, GainOfTurns, Gyros, Parameter, Turn
from ..errors import InputError
from ..motion.rests import check_meaning
from ..records import BenchRecord, PositionRecord, RawRecord, StrapdownRecord
from ..records.columns import INERTIAL
from ..records.rests import position_record_of, without_turns
from ..rounding import exactly, upwards
from .calibration import Asked, calibrate, calibrate_by_encoders, reading_uncertainty, wanted_targets, without_guarantee
from .estimates import Solution, open_directions, solve_system
from .in_motion import InMotion, lag_targets, with_motion
from .model import Linearisation
from .targets import MOTION_NAMES, Target, error_weights
from .turns import WithTurns, turns_of, with_turns

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

    from ..motion import AtTable

OF_AXES = ("X3", "X8", "-X12", "X13")
"""Targets whose errors turn the block by an angle that depends on the table's; what stays in the base drops out."""
GAINED = 0.99
"""A guaranteed error that becomes smaller than this part of itself is a gain."""
ANGLES_DEG = {"latitude_deg": 90.0, "azimuth_deg": 360.0}
LARGEST_ENCODER = 1e-3
"""No encoder of a table is off by more [rad]."""
NO_LAG = "no one lag of all accelerometers explains what they read in motion; diagnose says what does"
MORE_TURNS = (
    "turn the table by whole turns about both axes, the outer one at several inner angles, steadily for some seconds"
)
SAME_DEG = 1e-6
"""Angles that differ by less are the same, written with other digits."""


@dataclass(frozen=True)
class BenchOnEarth:
    """A bench's place on the earth and the bounds of its turns.

    The place is the latitude and the azimuth of the outer axis, from north towards east [deg]. The bounds are that of a
    gyro's mean over one second [rad/s], by default from the rests, and that of an encoder's error [rad]. The latter is
    by default σ, which includes the error of the encoders. `rates` is the meaning of a rate in the record.
    """

    latitude_deg: float
    azimuth_deg: float
    gyro_noise: float | None = None
    encoder_bound: float | None = None
    rates: str = "instantaneous"

    def __post_init__(self) -> None:
        for name, most in ANGLES_DEG.items():
            if not abs(value := getattr(self, name)) <= most:
                raise InputError(
                    f"--{name.replace('_', '-')} {exactly(value)}: must be from {-most:g} to {most:g} degrees"
                )
        for name, most in (("gyro_noise", 1.0), ("encoder_bound", LARGEST_ENCODER)):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and 0.0 < value <= most):
                raise InputError(
                    f"--{name.replace('_', '-')} {exactly(value)}: must be above 0 and at most {exactly(most)}"
                )
        check_meaning(self.rates)

    def encoder_within(self, noise_bound: float) -> float:
        """Return the bound of an encoder's error [rad]; by default σ, which includes it."""
        return float(noise_bound if self.encoder_bound is None else self.encoder_bound)

    @classmethod
    def given(cls, record: PositionRecord | StrapdownRecord, **options: Any) -> "BenchOnEarth | None":
        """Return the bench by options and by the comment lines of a bench record; None where neither names the place.

        Raises an InputError for an option without the place, or for a place that contradicts the record's.
        """
        place: dict[str, Any] = {}
        if isinstance(record, PositionRecord) and isinstance(record.raw, BenchRecord):
            place = said_of_place(record.raw)
        chosen = {name: value for name, value in options.items() if value not in (None, "instantaneous")}
        for name in ANGLES_DEG:
            if name not in chosen or name not in place:
                continue
            if abs(math.remainder(chosen[name] - place[name], 360.0)) > SAME_DEG:
                raise InputError(
                    f"--{name.replace('_', '-')} {exactly(chosen[name])}: {record.path} says '# {name}: "
                    f"{exactly(place[name])}'; leave the option out, or correct that line"
                )
        if place.keys() | chosen.keys() >= ANGLES_DEG.keys():
            return cls(**place | chosen)
        if name := next(iter(chosen), None):
            raise InputError(
                f"--{name.replace('_', '-')}: gyros are calibrated where --latitude-deg and --azimuth-deg are given"
            )
        return None


def said_of_place(raw: RawRecord | PositionRecord | StrapdownRecord) -> dict[str, float]:
    """Return the place, and the bounds of turns, from the comment lines of a record."""
    numbers = {}
    for name in ("latitude_deg", "azimuth_deg", "gyro_noise", "encoder_bound"):
        if (text := raw.about.get(name)) is not None:
            try:
                numbers[name] = float(text)
            except ValueError:
                raise InputError(f"{raw.path}: '# {name}: {text[:40]}': a number must stand there") from None
    return numbers


def calibrate_whole(record: PositionRecord, bench: BenchOnEarth | None = None, **options: Any) -> Calibration:
    """Calibrate bench and accelerometers from a record's rests, and the gyros of a bench record with a known place.

    The options are the fields of `Asked`. Raises an InputError as `calibrate` does. With a place it also raises one for
    another kind of record, for priors, for gyros that do not follow the table, and for unknown noise of the gyros.
    """
    is_of_bench = isinstance(record.raw, BenchRecord)
    if bench is None:
        calibration = calibrate_by_encoders(record, **{**options, "residuals_tell": True})
        warning = f"{record.path}: its gyros are not looked at; --latitude-deg and --azimuth-deg calibrate them too"
        return (
            calibration.model_copy(update={"warnings": [*calibration.warnings, warning]})
            if is_of_bench
            else calibration
        )
    if not is_of_bench:
        raise InputError(f"--latitude-deg: {record.path} has no gyros; a bench record (w1_radps, ...) is needed")
    request = Asked(**options)
    if request.priors:
        raise InputError(
            f"--prior {request.priors[0]}: is of accelerometers alone; leave out where {record.path} was measured "
            "(--latitude-deg, its comment line)"
        )
    calibration = calibrate(record, **options)
    system = fit_whole(calibration.linearised, record, bench, calibration.noise_bound)
    with_turns_too = with_gyros(calibration, record, bench, system, request)
    return _with_latency(with_turns_too, record, bench, system)


def judged_at_table(raw: BenchRecord, gravity: float) -> "AtTable":
    """Return the accelerometers' calibration by the rests of a bench record, with the record's σ; gravity [m/s²]."""
    try:
        rests = position_record_of(raw)
        calibration = calibrate(rests, gravity=gravity)
    except InputError as error:
        return motion.AtTable(verdict="insufficient", positions=0, lacks=str(error))
    sigma = {"noise_bound": calibration.noise_bound, "noise_bound_basis": calibration.sigma.basis}
    return motion.AtTable(
        verdict=calibration.verdict, positions=calibration.positions or 0, radius=calibration.radius, **sigma
    )


def fit_whole(alone: Linearisation, record: PositionRecord, bench: BenchOnEarth, noise_bound: float) -> WithTurns:
    """The model linearised at the fit to a bench record's rests, as they are linearised alone, and to its turns."""
    turns = turns_of(
        record,
        mounting=alone.parametrisation.matrices[0],
        earth=earth_in_base(math.radians(bench.latitude_deg), math.radians(bench.azimuth_deg)),
        encoder_bound=bench.encoder_within(noise_bound),
        noise_bound=bench.gyro_noise,
        rates=bench.rates,
    )
    return with_turns(alone, turns, str(record.path))


def with_gyros(
    calibration: Calibration, record: PositionRecord, bench: BenchOnEarth, system: WithTurns, request: Asked
) -> Calibration:
    """The calibration of a bench record's accelerometers taken together with its gyros, as the system fits them."""
    raw, alone = record.raw, calibration.linearised
    assert isinstance(raw, BenchRecord)
    targets = wanted_targets(alone.parametrisation, request)
    of_whole = [widened(target, len(system.point)) for target in targets + gyro_targets(system.own)]
    of_errors = np.pad(error_weights(alone.parametrisation), ((0, 0), (0, len(GYRO_PARAMETERS))))
    slack = reading_uncertainty(record.written_to(calibration.gravity))
    try:
        solution = solve_system(system, of_whole, slack, calibration.noise_bound, of_errors)
    except SolverError as error:
        raise InputError(f"{record.path}: {error}; is --gyro-noise in rad/s?") from error
    count, contradicted = len(targets), solution.contradicted
    of_gyros = solution.parameters[count:]
    pairs = zip(solution.parameters[:count], calibration.parameters, strict=True)
    of_bench = [_no_wider(together, before) for together, before in pairs]
    gains, witness = _gains(calibration.parameters, of_bench), []
    if contradicted:
        gains, witness = [], _turns(system, raw.time_s, solution)
    if not calibration.stands and calibration.verdict != "falsified":
        of_bench = calibration.parameters
    parameters = of_bench + of_gyros
    if calibration.sigma.kind == "unknown":
        parameters = without_guarantee(parameters)
    changed: dict[str, Any] = {
        "radius": solution.radius,
        # The bounds of the gyros do not grow with σ.
        "stands_with_sigma": None if contradicted else solution.radius * calibration.noise_bound,
        "gyros": Gyros(
            pieces=len(system.turns.first),
            noise_basis=system.turns.basis,
            encoder_bound_rad=bench.encoder_within(calibration.noise_bound),
            latitude_deg=float(bench.latitude_deg),
            azimuth_deg=float(bench.azimuth_deg),
            gains=gains,
            witness=witness,
            radius_of_rests=calibration.radius,
        ),
        "parameters": parameters,
        "open": calibration.open + open_directions(system, of_whole[count:], MORE_TURNS),
    }
    if contradicted and calibration.stands:
        changed |= {
            "verdict": "falsified",
            "estimator": "least squares",
            "no_estimate": "no parameters of bench, accelerometers and gyros keep every turn within its bound",
            "witness": [],
        }
    if not contradicted:
        changed["reading_errors"] = solution.reading_errors
    return calibration.model_copy(update=changed)


def _with_latency(
    calibration: Calibration, record: PositionRecord, bench: BenchOnEarth, system: WithTurns
) -> Calibration:
    """Return a calibration of the whole IMU with the accelerometers' latency, from their readings in motion."""
    moving = InMotion.of(
        record, calibration.linearised, calibration.gravity, bench.encoder_within(calibration.noise_bound)
    )
    slack = reading_uncertainty(record.written_to(calibration.gravity))
    try:
        lags = lag_targets(len(system.point))
        with_lags = with_motion(system, moving, calibration.gravity)
        solution = solve_system(with_lags, lags, slack, calibration.noise_bound)
    except SolverError as error:
        warning = f"the accelerometers' latency is not told: {error}"
        return calibration.model_copy(update={"warnings": [*calibration.warnings, warning]})
    parameters, warnings = solution.parameters, calibration.warnings
    if solution.contradicted and calibration.verdict != "falsified":
        # No value of the lag is one of the readings.
        parameters, warnings = [], [*warnings, NO_LAG]
    changed = {
        "parameters": calibration.parameters + parameters,
        "open": calibration.open + open_directions(with_lags, lags, MORE_TURNS),
        "warnings": warnings,
    }
    return calibration.model_copy(update=changed)


def gyro_targets(before: int) -> list[Target]:
    """Return a target for each parameter of the gyros, numbered after the `before` ones of bench and accelerometers."""
    targets = []
    for k, symbol in enumerate(GYRO_PARAMETERS):
        weights = np.zeros(before + len(GYRO_PARAMETERS))
        weights[before + k] = 1.0
        targets.append(Target(symbol, *MOTION_NAMES[symbol], weights))
    return targets


def widened(target: Target, count: int) -> Target:
    """A target of the bench, or of gyros, with weights for all parameters."""
    return Target(target.symbol, target.name, target.unit, np.pad(target.weights, (0, count - len(target.weights))))


def _no_wider(together: Parameter, alone: Parameter) -> Parameter:
    """Return the narrower of the guaranteed intervals by both together and by the accelerometers alone.

    Rounding may favour either.
    """
    if (
        together.estimate is None
        or together.low is None
        or together.high is None
        or alone.low is None
        or alone.high is None
    ):
        return together
    low, high = max(together.low, alone.low), min(together.high, alone.high)
    changed: dict[str, Any] = {"low": low, "high": high, "estimate": min(max(together.estimate, low), high)}
    if (alone.guaranteed_error or 0.0) < (together.guaranteed_error or 0.0):
        changed |= {"a_priori": alone.a_priori, "guaranteed_error": alone.guaranteed_error}
    return together.model_copy(update=changed)


def _gains(alone: Sequence[Parameter], together: Sequence[Parameter]) -> list[GainOfTurns]:
    """Return the targets whose guaranteed error the turns reduce."""
    gains = []
    for parameter, improved in zip(alone, together, strict=True):
        before, after = parameter.guaranteed_error, improved.guaranteed_error
        if before is not None and after is not None and after < GAINED * before:
            gains.append(GainOfTurns(symbol=parameter.symbol, accelerometers_alone=before, with_gyros=after))
    return gains


def _turns(system: WithTurns, time: NDArray, solution: Solution) -> list[Turn]:
    """Return the pieces whose duals prove a falsification."""
    behind, turns = system.reading.size, system.turns
    proof = np.flatnonzero((np.abs(solution.duals) * system.bound > 1e-9)[behind:])
    begin, end = time[turns.first[proof // 3]].tolist(), time[turns.last[proof // 3]].tolist()
    gyros = (proof % 3 + 1).tolist()
    return [Turn(gyro=gyro, from_s=a, to_s=b) for gyro, a, b in zip(gyros, begin, end, strict=True)]


def attitudes(
    targets: NDArray, time: NDArray, alpha: NDArray, beta: NDArray, mounting: NDArray, earth: NDArray
) -> Floats:
    """Attitude (N, 4) of the block against inertial space, unit quaternions, scalar first, body to reference.

    Parameters
    ----------
    targets : (18,) array
        in the order of `TARGETS`
    time, alpha, beta : (N,) array
        [s]; encoder readings [rad]
    mounting, earth : (3, 3), (3,) array
        Q; Earth's rotation in axes of the base [rad/s], whose axes are the reference at time zero
    """
    kappa, shift, epsilon = targets[:3]
    rotation = scipy.spatial.transform.Rotation

    def about(axis: int, angle: NDArray | float) -> "Rotation":
        return rotation.from_rotvec(np.atleast_1d(angle)[:, None] * np.eye(3)[axis])

    base = rotation.from_rotvec(time[:, None] * earth) * about(1, kappa)
    inner = base * about(0, alpha - shift) * about(1, epsilon) * about(2, beta)
    block = inner * rotation.from_matrix(mounting.T) * rotation.from_rotvec(targets[14:11:-1])
    return block.as_quat()[:, [3, 0, 1, 2]]


def strapdown_by_table(calibration: Calibration, record: PositionRecord, bench: BenchOnEarth | None) -> StrapdownRecord:
    """Return the strapdown record of a bench record, with the true attitude by the calibrated table.

    Its comments give the attitude as inertial, and its largest error at a row. Raises an InputError for a calibration
    that is not consistent, or not of the gyros too.
    """
    raw = record.raw
    if not isinstance(raw, BenchRecord) or calibration.gyros is None or bench is None:
        raise InputError("--strapdown: is of a bench record with --latitude-deg and --azimuth-deg")
    if not calibration.stands:
        raise InputError(f"--strapdown: the calibration is {calibration.verdict}: no table tells a true attitude")
    parameters = {e.symbol: e for e in calibration.parameters}
    if any(symbol not in parameters for symbol in TARGETS):
        raise InputError("--strapdown: is of --convention A1 and --baseline asymmetric")
    values = np.array([parameters[symbol].estimate for symbol in TARGETS], dtype=float)
    errors = np.array([parameters[symbol].error_bound for symbol in OF_AXES], dtype=float)
    earth = earth_in_base(math.radians(bench.latitude_deg), math.radians(bench.azimuth_deg))
    (mounting,) = calibration.mountings.values()
    alpha, beta = without_turns(raw.alpha), without_turns(raw.beta)
    attitude = attitudes(values, raw.time_s - raw.time_s[0], alpha, beta, np.array(mounting), earth)
    bound = math.sqrt(2.0) * calibration.gyros.encoder_bound + float(errors.sum())
    key, value = INERTIAL
    comments = {key: value, "attitude_bound_arcmin": upwards(bound / ARCMIN, 2)}
    return replace(raw.gyros, attitude=attitude, about={**raw.about, **comments})
