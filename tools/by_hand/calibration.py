"""The procedure of `trihedron calibrate` without a table: from a record of any kind to a calibration."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.bench import BIAS, GYRO_PARAMETERS, MATRIX
from ..calibrated import (
    UNITS,
    ByHand,
    Calibration,
    Case,
    HandGain,
    KnownBefore,
    Open,
    Parameter,
    PoseError,
    Provenance,
    Sigma,
    TurnError,
    Verdict,
    units_of,
)
from ..motion.determinacy import DETERMINED, LEAST_SD, PRIOR_SD, UNSEEN, USABLE, USABLE_TURN, closing_poses
from ..motion.norm import NAMES, UNITS_OF, norm_equations
from ..motion.possible import BOX, Possible, central_parameters, nearest_possible, possible_forces
from ..records import ForceRecord, PoseRecord
from ..result import finite_or_none
from ..rounding import digits, upwards
from .forces import Faces, Forces, Norms, fitted_forces, scatter_of
from .gyros import MOVE_ERROR, GyroFit, fitted_gyros
from .gyros import PRIOR as GYRO_PRIOR
from .moves import ROUGH, TURN_BIAS, Moves, Turns, Windows
from .run import HandRecord, HandRequest, Run, run_of

WORDS = (
    (DETERMINED, "determined"),
    (3e-3, "determined to {}"),
    (USABLE, "usable"),
    (3e-2, "near the poses seen"),
)
"""Largest predicted error of an unseen pose [g], and its word."""
UNDETERMINED = "not determined"
MAIN_PART = 0.3
"""Parts of a direction below this, of its largest, are not named."""
MOST_POSES = 6
"""Largest number of poses that are asked for."""
WELL = 3e-3
"""Largest predicted error of an unseen pose that asks for no further pose [g]."""
CHANCE = 1e-3
"""Readings scatter by more than a given noise where chance explains it with a smaller probability."""
FOLDS, FEWEST_FOLDED = 5, 12
"""Contiguous parts that are left out in turn; of fewer rests none is."""
LARGE, LARGE_OF_GYRO = 0.2, 0.06
"""A larger parameter of accelerometers, and a larger scale factor error of a gyro, get a warning."""
LEAST_OF_CLOCK = 3e-3
"""A smaller common scale factor error of the gyros is not worth a remark on the clock."""
CONTRADICTED = 4.0
"""A known turn is wrong where the moves contradict it by this number of standard deviations."""
ALIKE = 2.0
"""Known turns are doubted where usual gyros miss their mean by this number of standard deviations."""
FAR_MOVE = 10.0
"""A move whose error exceeds the median, and the usual error of a move, by this factor is left out."""
FAR_OF_PRIOR, FEWEST_SOUND = 6.0, 10
"""So is one that usual gyros miss by this number of standard deviations, of fewer than ten moves only such ones."""
FAR_FACE = np.radians(30.0)
"""Farther from a face no case is tilted [rad]."""
MORE = 3.0
"""Scatter of the norms over the assumed scatter from which a warning follows."""
SMALL = 1e-6
"""Bound of a reading with which second order does not count [g]."""
HALF_PRIOR = 0.5
"""A parameter is determined where its error is below this part of the prior's."""
KINDS = {ForceRecord: "accelerometers", PoseRecord: "poses"}
"""Kinds of records that have no gyros."""
MORE_RESTS = "more rests, of two seconds and more"


@dataclass(frozen=True, eq=False)
class HandFit:
    """Fit of a run.

    Attributes
    ----------
    norms : Norms
    forces : Forces
    gyros : GyroFit or None
    scatter, chance : float
        ratio of the readings' scatter to its assumed value, and the probability of a larger one
    spare : float
        number of readings beside the parameters that they determine
    """

    norms: Norms
    forces: Forces
    gyros: GyroFit | None
    scatter: float
    chance: float
    spare: float

    @property
    def deviation(self) -> float:
        """The median of the standard deviations of mean readings [g]."""
        return float(np.median(self.norms.deviation)) if len(self.norms.deviation) else LEAST_SD


@dataclass(frozen=True, eq=False)
class Bounds:
    """Result of bounds of the readings' errors: the least bound with which the model stands [g], and by σ the possible
    values.

    `estimate` (6 + 3 R,) is least squares, or the possible values nearest to it; `possible` is None where nothing tells
    σ.
    """

    least: float
    estimate: Floats
    possible: Possible | None

    @classmethod
    def of(cls, forces: Forces, norms: Norms, bound: float | None) -> "Bounds":
        """Return the bounds by the norms at rest near an estimate (6 + 3 R,)."""
        x = forces.x
        if not len(norms.reading):
            return cls(0.0, x, None)
        rows = norms.reading, np.full(norms.reading.shape, SMALL if bound is None else bound), norms.run
        radius, centre = central_parameters(x, *rows)
        least = radius * (SMALL if bound is None else bound)
        if bound is None:
            return cls(least, x, None)
        possible = possible_forces(x, *rows)
        if possible.radius <= 1.0:
            x = nearest_possible(x, forces.covariance, centre, *rows)
        return cls(least, x, possible)

    def those(self, columns: Ints) -> "Bounds":
        """Return the bounds with some of the parameters."""
        possible = None if self.possible is None else self.possible.those(columns)
        return Bounds(self.least, self.estimate[columns], possible)


def fit_of(run: Run, near: HandFit | None = None) -> HandFit:
    """Fit accelerometers by the norm of gravity, and the gyros with these; `near` is a fit of much the same run."""
    norms = Norms.of(run.rests.force, run.deviation)
    forces = fitted_forces(norms, run.faces)
    scatter, chance = scatter_of(forces, norms, known=bool(run.basis), measured=run.tells_noise)
    if scatter > 1.0 and (not run.basis or chance < CHANCE):
        norms = replace(norms, deviation=norms.deviation * scatter)
        forces = fitted_forces(norms, run.faces)
    fit = HandFit(norms, forces, None, scatter, chance, norms.spare(forces))
    return with_gyros(run, fit, None if near is None else near.gyros)


def with_gyros(run: Run, fit: HandFit, near: GyroFit | None = None) -> HandFit:
    """Return the fit of a run with its gyros, by its accelerometers."""
    if run.moves is None:
        return fit
    return replace(fit, gyros=fitted_gyros(run.rests, fit.deviation, fit.forces, run.moves, run.turns, near))


def checked_fit(run: Run) -> tuple[Run, HandFit]:
    """Return a run without the faces and turns that its readings contradict, each with a warning, and its fit."""
    if run.faces is not None and not isinstance(run.moves, Windows):
        run = _with_checked_faces(run, run.faces)
    run = _with_sound_moves(run)
    turns = run.turns
    if turns is None:
        fit = fit_of(run)
        worst = float(fit.forces.determinacy.pose_errors().max())
        if isinstance(run.moves, Windows) and fit.forces.case is not None and worst <= USABLE:
            run = replace(run, moves=run.moves.in_axes_of(fit.forces))
            fit = with_gyros(run, fit)
        return run, fit
    run = _with_checked_turns(run, turns)
    return run, fit_of(run)


def _with_checked_turns(run: Run, turns: Turns) -> Run:
    """Return a run without the known turns that its other readings contradict.

    Turns that differ alike from gyros of the usual size are doubted: the error of their angles holds that difference.
    """
    without = fit_of(replace(run, turns=None)).gyros
    assert without is not None
    off, slopes = turns.rows(without.values)
    error = np.sqrt(1.0 + np.einsum("ti,ij,tj->t", slopes, without.covariance, slopes))
    wrong = np.abs(off) > CONTRADICTED * error
    warnings = list(run.warnings)
    for number in np.flatnonzero(wrong):
        degrees = [digits(float(np.degrees(angle)), 3) for angle in (turns.angle[number], off[number] * turns.error)]
        warnings.append(
            f"turn {number + 1}: by the moves it differs by {degrees[1]}° from the known {degrees[0]}°: it is not used"
        )
    kept = np.flatnonzero(~wrong)
    turns = replace(turns, way=turns.way.those(kept), angle=turns.angle[kept])
    if len(kept):
        common, by_gyros = float(off[kept].mean()), slopes[kept].mean(axis=0)
        if abs(common) > max(CONTRADICTED, ALIKE * float(np.sqrt(by_gyros @ without.covariance @ by_gyros))):
            turns = replace(turns, error=abs(common) * turns.error)
            size, sense = digits(float(np.degrees(turns.error)), 2), "more" if common > 0.0 else "less"
            warnings.append(
                f"the gyros read {size}° {sense} than the known turns, on average: are these right? Each is taken as "
                f"known to {size}° (1 sd)"
            )
    return replace(run, turns=turns, warnings=tuple(warnings))


def _with_sound_moves(run: Run) -> Run:
    """Return a run without the moves that miss gravity far more than the others; with all where a third does."""
    moves = run.moves
    if not isinstance(moves, Moves) or not len(moves):
        return run
    fit = fit_of(replace(run, turns=None, moves=moves.those(np.zeros(0, dtype=int))))
    gyros = fit.gyros
    assert gyros is not None
    # As gyros without moves know them: biases at rest, and the prior.
    pieces = moves.rows(fit.forces, gyros.values)
    variance = np.einsum("mdi,ij,mdj->m", pieces.by_gyros, gyros.covariance, pieces.by_gyros)
    variance += pieces.by_readings.sum(axis=1) * fit.deviation**2 + MOVE_ERROR**2
    sizes = np.linalg.norm(pieces.error, axis=1)
    sound, used = sizes <= FAR_OF_PRIOR * np.sqrt(variance), np.zeros(len(moves), dtype=bool)
    while sound.sum() >= FEWEST_SOUND and (sound != used).any():
        used = sound
        gyros = with_gyros(replace(run, turns=None, moves=moves.those(np.flatnonzero(used))), fit, gyros).gyros
        assert gyros is not None
        sizes = np.linalg.norm(moves.rows(fit.forces, gyros.values).error, axis=1)
        sound = used & (sizes <= FAR_MOVE * max(float(np.median(sizes[used])), MOVE_ERROR))
    if sound.all() or 3 * (~sound).sum() >= len(moves):
        return run
    times = moves.way.series.time_s[moves.way.ends[~sound, 0]]
    line = (
        f"the moves after {', '.join(digits(time, 5) for time in times.tolist())} s miss gravity by up to "
        f"{digits(float(np.degrees(sizes.max())), 2)}°, far more than the others, and are left out: "
        "are rows lost there?"
    )
    return replace(run, moves=moves.those(np.flatnonzero(sound)), warnings=(*run.warnings, line))


def _with_checked_faces(run: Run, faces: Faces) -> Run:
    """Return a run without the faces that are far from its readings; without any where a third of them is.

    The farthest face is left out first, and the others are compared anew.
    """
    count, wrong = len(faces.known), []
    forces = fitted_forces(Norms.of(run.rests.force, run.deviation))
    while (case := faces.case_of(forces.x, run.rests.force)) is not None:
        tilts = faces.tilts(forces.x, case, run.rests.force)
        number = int(faces.known[np.argmax(tilts)])
        if tilts.max() <= FAR_FACE:
            break
        wrong.append(number + 1)
        up = faces.up.copy()
        up[number] = np.nan
        faces = replace(faces, up=up)
    if not wrong:
        return run
    named = ", ".join(map(str, sorted(wrong)))
    line = f"rest {named}: another axis than its face points up; the face is not used: check the faces and their order"
    if 3 * len(wrong) >= count:
        line = f"the faces contradict the readings (rests {named}): none is used; give the axis that points up"
        return replace(run, faces=None, warnings=(*run.warnings, line))
    return replace(run, faces=faces, warnings=(*run.warnings, line))


def calibrate_by_hand(record: HandRecord, request: HandRequest) -> Calibration:
    """Calibrate accelerometers, and gyros where there are any, of a block in any poses.

    Parameters
    ----------
    record : StrapdownRecord, ForceRecord or PoseRecord
    request : HandRequest

    Returns
    -------
    Calibration
        estimates, standard errors, open parameters and how to close them; guaranteed intervals of the accelerometers
        where σ is given

    Raises
    ------
    InputError
        for a record or options that cannot be used, in one line

    Notes
    -----
    The accelerometers come from the norm of gravity at rest, by least squares with a weak prior; the gyros from the
    directions of gravity before and after each move. Guaranteed is what `possible_forces` proves.
    """
    run, fit = checked_fit(run_of(record, request))
    bounds = Bounds.of(fit.forces, fit.norms, run.bound)
    return calibration_of(run, fit, bounds, request.gravity, gain_of(run, fit))


def calibration_of(run: Run, fit: HandFit, bounds: Bounds, gravity: float, gain: HandGain | None) -> Calibration:
    """Return the calibration by a fit of a run, its possible values by the bound, and the gain at left-out rests."""
    pose = fit.forces.determinacy.pose_errors()
    verdict = _verdict(run, fit, bounds.possible, float(pose.max()))
    axes = "accelerometers"
    if isinstance(run.moves, Windows) and run.moves.case_error is None:
        axes = "true attitude"
    basis = _basis(run, fit, gain).model_copy(update={"axes": axes})
    return Calibration(
        verdict=verdict,
        sigma=_sigma(run, fit),
        stands_with_sigma=bounds.least,
        radius=None if run.bound is None else bounds.least / run.bound,
        gravity_mps2=float(gravity),
        estimator="least squares",
        no_estimate="",
        parameters=parameters_of(fit, bounds),
        units=UNITS | {"by_hand": "as each key says"},
        priors=_priors(bounds.possible),
        by_hand=basis,
        open=[*open_of_forces(fit), *open_of_gyros(fit.gyros)],
        provenance=provenance_of(run.record),
        warnings=[*run.record.warnings, *run.warnings, *_remarks(run, fit)],
    )


def _verdict(run: Run, fit: HandFit, possible: Possible | None, worst: float) -> Verdict:
    """Return the verdict: by the set of possible parameters where there is one, and by predicted errors."""
    if possible is not None and possible.radius > 1.0:
        return "falsified"
    if worst > USABLE or (fit.gyros is not None and fit.gyros.turn_error()[0] > USABLE_TURN):
        return "insufficient"
    if not run.basis and run.tells_noise and len(run.rests) and fit.spare < 1.0:
        return "insufficient"
    return "usable" if run.bound is None else "consistent"


def _sigma(run: Run, fit: HandFit) -> Sigma:
    """Return σ as it was given, or three standard deviations of a mean reading, estimated."""
    if run.bound is not None:
        return Sigma.of(run.bound, run.basis)
    value = min(3.0 * fit.deviation, 0.99)
    basis = f"3 sd of a mean at rest, {upwards(1e3 * value / 3.0, 2)} mg: {_why(run, fit)}"
    return Sigma.model_validate({"value": value, "kind": "estimated", "from": basis})


def _why(run: Run, fit: HandFit) -> str:
    if not run.tells_noise and fit.spare < 1.0:
        return "assumed, as no reading is beside the parameters"
    if fit.scatter > 1.0:
        return "the scatter of the norms"
    if len(run.deviation) and np.median(run.deviation) > LEAST_SD:
        return "the noise within the rests"
    return "the least that real instruments leave, more than the noise at rest"


def name_of(symbol: str) -> str:
    """Return a parameter in words: gamma_21 is the misalignment of accelerometer 2 towards axis 1."""
    if symbol.startswith("bias"):
        return f"bias of accelerometer {symbol[-1]}"
    if symbol == "L":
        return "lag of the gyros"
    if symbol.startswith("B"):
        return f"bias of gyro {symbol[-1]}"
    row, axis = symbol[-2], symbol[-1]
    if symbol.startswith("S"):
        return f"sensitivity of gyro {row} to gravity along axis {axis}"
    sensor = f"accelerometer {row}" if symbol.startswith("gamma") else f"gyro {row}"
    return f"scale factor error of {sensor}" if row == axis else f"misalignment of {sensor} towards axis {axis}"


def parameters_of(fit: HandFit, bounds: Bounds) -> list[Parameter]:
    """Return the fitted parameters; of accelerometers the possible values nearest to those of least squares."""
    forces, gyros = fit.forces, fit.gyros
    ends = np.full((2, len(NAMES)), np.nan)
    if bounds.possible is not None and bounds.possible.ends is not None:
        ends = bounds.possible.ends
    determined = forces.determinacy.determined
    columns = [NAMES, bounds.estimate, forces.determinacy.standard_errors, determined, forces.x, *ends]
    rows = list(zip(*columns, strict=True))
    if gyros is not None:
        for number in gyros.fitted.tolist():
            value, error = gyros.values[number], gyros.errors[number]
            known = error < HALF_PRIOR * GYRO_PRIOR[number]
            rows.append((GYRO_PARAMETERS[number], value, error, known, value, np.nan, np.nan))
    parameters = []
    for symbol, estimate, error, known, squares, *limits in rows:
        low, high = map(finite_or_none, limits)
        parameters.append(
            Parameter(
                symbol=symbol,
                name=name_of(symbol),
                unit=UNITS_OF.get(symbol) or units_of(symbol)[0],
                determined=bool(known),
                estimate=float(estimate),
                standard_error=float(error),
                low=low,
                high=high,
                least_squares=float(squares),
            )
        )
    return parameters


def _priors(possible: Possible | None) -> list[KnownBefore]:
    """Return the box about the estimate in which the possible parameters are looked for."""
    if possible is None or possible.ends is None:
        return []
    return [KnownBefore(expression="any of the nine parameters of the accelerometers less its estimate", limit=BOX)]


def _basis(run: Run, fit: HandFit, gain: HandGain | None) -> ByHand:
    """Return the basis of a calibration, with its predicted errors."""
    pose = fit.forces.determinacy.pose_errors()
    worst = int(np.argmax(pose))
    norms = norm_equations(fit.forces.x, run.rests.force)[0]
    gyros = fit.gyros
    turn = sensitivity = case = missed = largest = None
    if gyros is not None:
        error, axis = gyros.turn_error()
        turn = TurnError(worst_rad=error, axis=axis.tolist())
        sensitivity = gyros.sensitivity
        if len(gyros.missed):
            sizes = np.linalg.norm(gyros.missed, axis=1)
            missed, largest = _rms(sizes), float(sizes.max())
    if fit.forces.case is not None:
        case = Case(rotation=fit.forces.case.tolist(), standard_error_rad=fit.forces.case_error)
    return ByHand(
        rests=len(run.rests),
        moves=0 if run.moves is None else len(run.moves),
        turns=0 if run.turns is None else len(run.turns),
        pose_error=PoseError(
            worst_g=float(pose[worst]),
            rms_g=_rms(pose),
            direction=UNSEEN[worst].tolist(),
            words=grade(float(pose[worst])),
        ),
        turn_error=turn,
        residual_g=_rms(norms),
        residual_rad=missed,
        largest_rad=largest,
        sensitivity=sensitivity,
        case=case,
        gain=gain,
        scatter_limit=run.rests.limit,
        covariance=fit.forces.covariance.tolist(),
        turn_covariance=None if gyros is None else gyros.covariance[MATRIX, MATRIX].tolist(),
    )


def _rms(values: NDArray) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else 0.0


def gain_of(run: Run, whole: HandFit) -> HandGain | None:
    """Return the errors of rests and moves that were left out, in five contiguous parts; None of too few rests.

    Of a run with a true attitude its windows are left out, and no rests. `whole` is the fit of the whole run; the fits
    of its parts begin there.
    """
    if run.moves is not None:
        run = replace(run, moves=replace(run.moves, way=replace(run.moves.way, near=ROUGH)))
    windows = run.moves if isinstance(run.moves, Windows) else None
    count = len(run.rests) if windows is None else len(windows)
    if count < FEWEST_FOLDED and windows is None:
        return None
    errors: dict[str, list[float]] = {}
    for part in np.array_split(np.arange(count), FOLDS):
        fit, unseen = fit_of(run.part(np.setdiff1d(np.arange(count), part)), whole), run.part(part)
        if windows is None:
            off = norm_equations(fit.forces.x, unseen.rests.force)[0]
            errors.setdefault("rest_before_g", []).extend(np.linalg.norm(unseen.rests.force, axis=1) - 1.0)
            errors.setdefault("rest_after_g", []).extend(off)
        if unseen.moves is not None and fit.gyros is not None and len(unseen.moves):
            after = unseen.moves.rows(fit.forces, fit.gyros.values).error
            errors.setdefault("move_before_rad", []).extend(np.linalg.norm(_as_read(unseen.moves, fit), axis=1))
            errors.setdefault("move_after_rad", []).extend(np.linalg.norm(after, axis=1))
    names = ("rest_before_g", "rest_after_g", "move_before_rad", "move_after_rad")
    return HandGain(**{name: _rms(np.array(errors[name])) if name in errors else None for name in names})


def _as_read(pieces: Moves | Windows, fit: HandFit) -> Floats:
    """Return the errors (M, d) of pieces by instruments as they read, but for the biases of the gyros."""
    assert fit.gyros is not None
    values = np.zeros(len(fit.gyros.values))
    values[BIAS] = fit.gyros.values[BIAS]
    return pieces.rows(replace(fit.forces, x=np.zeros(9)), values).error


def open_of_forces(fit: HandFit) -> list[Open]:
    """Return the open directions of the accelerometers, each with a pose that closes it."""
    before = fit.forces.determinacy
    directions = before.open
    poses = closing_poses(before, max(WELL, 3.0 * fit.deviation), fit.deviation, MOST_POSES)
    entries = []
    for pose in poses:
        gain = (np.diag(before.covariance) - np.diag(pose.after.covariance)) / PRIOR_SD**2
        entries.append(Open(parameters=_main(gain), close_by=f"a rest with {pose.words}"))
        before = pose.after
    for direction in directions[len(poses) :]:
        entries.append(Open(parameters=_main(np.abs(direction)), close_by=MORE_RESTS))
    return entries


def _main(parts: NDArray) -> list[str]:
    """Return the parameters whose parts (9,) are not far below the largest."""
    return [name for name, part in zip(NAMES, parts, strict=True) if part > MAIN_PART * parts.max()]


def grade(worst: float) -> str:
    """Return the word for a predicted error of an unseen pose [g]."""
    for limit, word in WORDS:
        if worst <= limit:
            return word.format(f"{upwards(1e3 * worst)} mg")
    return UNDETERMINED


def open_of_gyros(gyros: GyroFit | None) -> list[Open]:
    """Return the axes about which turns leave the gyros open."""
    if gyros is None:
        return []
    entries = []
    errors = gyros.errors[MATRIX].reshape(3, 3)
    priors = GYRO_PRIOR[MATRIX].reshape(3, 3)
    worst, about = gyros.turn_error()
    for axis in range(3):
        is_open = errors[:, axis] >= HALF_PRIOR * priors[:, axis]
        if worst > USABLE_TURN and axis == np.argmax(np.abs(about)):
            is_open[np.argmax(errors[:, axis])] = True
        if is_open.any():
            names = [f"M{row + 1}{axis + 1}" for row in np.flatnonzero(is_open)]
            how = (
                f"turns by 90° and more about axis {axis + 1}, there and back, with this axis level, from rest to rest"
            )
            entries.append(Open(parameters=names, close_by=how))
    return entries


def provenance_of(record: HandRecord) -> Provenance:
    """Return the provenance of a calibration: record, digest, kind, temperatures, comments."""
    extent = None
    if record.temperature is not None:
        extent = [float(record.temperature.min()), float(record.temperature.max())]
    return Provenance(
        record=record.path.name,
        record_sha256=record.sha256,
        kind=KINDS.get(type(record), "by hand"),
        temperature_degC=extent,
        comments=dict(record.about),
        decisions=str(record.decisions or ""),
    )


def _remarks(run: Run, fit: HandFit) -> list[str]:
    """Return warnings on the scatter, the size of parameters and the faces."""
    remarks = []
    if run.basis and fit.chance < CHANCE:
        remarks.append(
            f"the norms scatter {digits(fit.scatter, 2)} times as much as the given noise explains: the standard "
            "errors hold that scatter"
        )
    elif fit.scatter > MORE and run.tells_noise:
        remarks.append(
            f"the norms scatter by {digits(1e3 * fit.deviation, 2)} mg, {digits(fit.scatter, 2)} "
            "times as much as the noise at rest: this model does not explain everything"
        )
    elif fit.scatter > MORE and fit.spare >= 1.0:
        remarks.append(
            f"the norms scatter by {digits(1e3 * fit.deviation, 2)} mg: readings are so noisy, or the model does not "
            "explain everything"
        )
    is_of_use = not run.tells_noise or fit.forces.determinacy.worst <= USABLE
    if not run.basis and len(run.rests) and is_of_use and fit.spare < 1.0:
        remarks.append(
            "no rest is beside the parameters, so nothing tests that a reading errs by "
            f"{digits(1e3 * fit.deviation, 2)} mg (1 sd), as is assumed: add poses, or give --noise-sd or --noise-bound"
        )
    large = [
        f"{name} = {digits(float(value), 2)}"
        for name, value in zip(NAMES, fit.forces.x, strict=True)
        if abs(value) > LARGE
    ]
    if large:
        remarks.append(f"values far from an instrument's ({', '.join(large)}): are unit and --gravity right?")
    if fit.gyros is not None:
        # The length of a row is the same in all axes, as in those of a true attitude.
        rows = np.linalg.norm(np.eye(3) + fit.gyros.values[MATRIX].reshape(3, 3), axis=1)
        for axis, value in enumerate(rows - 1.0, start=1):
            if abs(value) > LARGE_OF_GYRO:
                remarks.append(
                    f"gyro {axis} has a scale factor error of {digits(100.0 * value, 2)} %: are unit, rows and known "
                    "turns right?"
                )
        error = float(np.sqrt(np.diag(fit.gyros.covariance)[MATRIX][::4].mean() / 3.0))
        common = float(rows.mean() - 1.0)
        if abs(common) > max(2.0 * float(rows.std()), 3.0 * error, LEAST_OF_CLOCK):
            size, sense = digits(100.0 * abs(common), 2), "fast" if common > 0.0 else "slow"
            remarks.append(
                f"all gyros' scale factors err alike, by {'' if common > 0.0 else '-'}{size} %: a clock of the record "
                f"that runs {sense} by {size} % would show so too; the record does not tell which"
            )
        if (np.square(fit.gyros.by_turns[MATRIX][::4]) > 0.5 * np.square(fit.gyros.errors[MATRIX][::4])).any():
            remarks.append(
                "known turns alone tell scale factors of the gyros, and nothing tests these: all may err alike by "
                f"{digits(float(np.degrees(TURN_BIAS)), 2)}° (1 sd); turn several times round, as 3:3600, or about "
                "level axes from rest to rest"
            )
    if fit.gyros is not None and run.moves is not None and run.moves.way.series.lost:
        remarks.append(
            f"about {digits(100.0 * run.moves.way.series.lost, 2)} % of the rows seem lost though the time stamps are "
            "even: in moves all readings change at once as over two rows. Turns then read too small, and the errors of "
            "the gyros hold that; log the time or number of each sample"
        )
    change = None if fit.gyros is None else fit.gyros.change
    if change is not None and run.moves is not None:
        sizes = " and ".join(
            f"gyro {axis + 1} by {digits(float(change.size[axis]), 2)} rad/s" for axis in np.flatnonzero(change.size)
        )
        when = "drift over the record"
        if change.rest is not None:
            time = float(run.moves.way.series.time_s[run.rests.rows[change.rest].start])
            when = f"change before {digits(time, 4)} s"
        remarks.append(
            f"the rates at rest {when}, of {sizes}: B is between, and its standard errors hold that; calibrate the "
            "parts of the record as runs of their own"
        )
    if run.faces is not None and fit.forces.case is None and not isinstance(run.moves, Windows):
        remarks.append("the faces name one axis only: the axes of the case stay unknown; name faces of two axes")
    return remarks
