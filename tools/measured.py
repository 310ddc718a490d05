"""Functions of `import trihedron as th` on measured records: read, import, check, calibrate, diagnose, correct.

As in `library`, each function is documented once and imports its modules when it is called.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from . import by_hand, diagnosis, foreign, motion, orchestrator, own_effects, records
from . import calibration as calibrations
from . import check as checks
from . import noise as noises
from .errors import InputError
from .memory import keeping
from .options import (
    Baseline,
    Bounds,
    BridgeGaps,
    Channels,
    Convention,
    EffectsFrom,
    ExplainedBy,
    Extend,
    Faces,
    Gravity,
    Mounting,
    NoiseBound,
    NoiseResult,
    NoiseSd,
    Own,
    Progress,
    Rates,
    RecordBaseline,
    ReferenceBound,
    RestScatter,
    RestsFile,
    Shared,
    Stamps,
    Targets,
    Trust,
    Turns,
    Without,
)

NORM_ALONE = "beside records by hand, positions of a table count by the norm of gravity alone, not by their angles"


def import_record(
    file: "str | Path | records.Source",
    second: str | Path | None = None,
    *,
    out: str | Path | None = None,
    mapping: str | Path | None = None,
    answers: Mapping[str, str] | None = None,
    preset: str = "",
    part: str = "",
) -> "foreign.Imported":
    """Make a record from a measured file: CSV, Excel, MATLAB, HDF5, ULog, ROS bags, and others.

    Nothing is guessed silently: all open questions are asked at once, with the options that answer them.

    Parameters
    ----------
    file : path
        The file; from Python also a table in memory.
    second : path, optional
        The gyros, where the first file has the accelerometers alone. The record has the faster clock of both.
    out : path, optional
        The record (CSV). The mapping goes into RECORD.import.toml beside it.
    mapping : path, optional
        Mapping to use: a RECORD.import.toml of an earlier import, with your changes.
    answers : mapping, optional
        Answer to an open question, as KEY=VALUE: units.force=g, dates=day-first. Repeat it for several.
    preset : str, optional
        Known layout of columns and units, as px4, ros, xsens or adis. Without it, the names of the columns decide.
    part : str, optional
        Table of a file that holds several, as imu/data_raw; --list shows them.

    Returns
    -------
    Imported
        The record, and the columns it was made from.

    Raises
    ------
    InputError
        for an open question, or a file that cannot be used

    Examples
    --------
    >>> import trihedron as th
    >>> th.import_record("messung.csv", answers={"units.force": "mg"}).record  # doctest: +SKIP
    """
    given = {"preset": preset, "part": part}
    return foreign.make_record(
        file,
        None if second is None else Path(second),
        out=None if out is None else Path(out),
        mapping=None if mapping is None else Path(mapping),
        answers=dict(answers or {}) | {key: text for key, text in given.items() if text},
    )


def check(file: str | Path, *, channels: Channels = (), stamps: Stamps = None, trust: Trust = False) -> "checks.Check":
    """List all problems of a file with their lines, without running it.

    Parameters
    ----------
    file : path
        A record, scenario, campaign, calibration, diagnosis, plan, programme, mounting, proof of a bound, FMU or SSP.

    Returns
    -------
    Check
        The kind of file and its problems.

    Raises
    ------
    InputError
        no file that can be read
    """
    return checks.check(file, channels, stamps, trust=trust)


def inspect(
    record: "records.Source",
    *,
    gravity: Gravity = 9.80665,
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
) -> "motion.Inspection":
    """Show the sampling, rests and moves of a strapdown record, and its instruments at rest.

    In a bench record the accelerometers are compared with the table's angles, as `calibrate` does without options.

    Parameters
    ----------
    record : path, table in memory or record
        Strapdown record or bench record, CSV or Parquet.

    Returns
    -------
    Inspection
        Sampling, rests, and the instruments at rest.

    Raises
    ------
    InputError
        for a record of a table, or gravity that is none
    """
    run = records.read_record(record, records.StrapdownRecord, records.BenchRecord, channels=channels, stamps=stamps)
    if isinstance(run, records.StrapdownRecord):
        parted = by_hand.parted_at_cuts(run, gravity) if 1.0 <= gravity <= 100.0 else run
        return motion.inspect_record(run, gravity=gravity, trust=trust, parted=parted)
    inspection = motion.inspect_record(run.gyros, gravity=gravity, trust=trust)
    at_table = calibrations.judged_at_table(run, gravity)
    return inspection.model_copy(update={"accelerometers": None, "at_table": at_table})


def noise(
    record: "records.Source",
    *others: "records.Source",
    dwell: float | None = None,
    positions: int = 24,
    gap: float = 0.0,
    probability: float = 0.95,
    skip: float = 0.0,
    against: str | Path | None = None,
    gravity: Gravity = 9.80665,
    channels: Channels = (),
    trust: Trust = False,
    progress: Progress = False,
) -> "noises.Noise":
    """Identify the noise of gyros and accelerometers from a record of the block at rest.

    White noise, quantisation, bias instability, random walk, correlated noise and ramp are fitted to the spectrum. Of a
    record with moves its rests are taken.

    Parameters
    ----------
    record : path, table in memory or record
        Strapdown, bench or raw record, or accelerometers alone, CSV or Parquet; an hour at rest tells most.
    others : path, table in memory or record
        Further records of the same instrument, of the same rate.
    dwell : float, optional
        Averaging time of a position [s]; the result gives σ for it.
    positions : int
        Number of positions of that calibration.
    gap : float
        Time between its rests [s].
    probability : float
        Probability that all its readings keep the bound.
    skip : float
        Time at the start of each record that is left out: warm-up [s].
    against : path, optional
        A scenario (TOML): the record's noise is held against that of its blocks.

    Returns
    -------
    Noise
        Coefficients with intervals, Allan deviation, growth of attitude and velocity errors.

    Raises
    ------
    InputError
        for a record without a rest or with wrong readings, or records that do not go together
    """
    kinds = records.StrapdownRecord, records.ForceRecord, records.BenchRecord, records.RawRecord
    runs = []
    for source in (record, *others):
        run = records.read_record(source, *kinds, channels=channels)
        runs.append(_trusted_in_parts(run, trust=trust, gravity=gravity))
    scenario = None if against is None else orchestrator.read_scenario(against)
    result = noises.identify(runs, gravity=gravity, skip=skip, scenario=scenario, progress=progress)
    if dwell is None:
        return result
    averaged = result.average(dwell, positions, gap_s=gap, probability=probability)
    return result.model_copy(update={"averaged": averaged})


def attitude_of_record(
    record: "records.Source",
    *,
    algorithm: str = "two-sample-rodrigues",
    rates: Rates = "instantaneous",
    rate_divisor: int = 1,
    bridge_gaps: BridgeGaps = 0,
    gyro_bias: Sequence[float] | None = None,
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    out: Path | None = None,
    progress: Progress = False,
) -> "motion.AttitudeRun":
    """Compute the attitude of a strapdown record by the attitude computer's FMU, and its error if the truth is known.

    A gyro at its limit makes every later attitude worthless: it is marked as not to be trusted.

    Parameters
    ----------
    record : path, table in memory or record
        Strapdown record, CSV or Parquet.
    algorithm : str
        Name of the attitude algorithm; --compare runs all.
    rate_divisor : int
        Number of increments to add up to one, as a slower gyro would.
    gyro_bias : sequence of 3 float, optional
        Rate that is taken out of every sample [rad/s].
    out : path, optional
        Folder for the computed attitude, or for the comparison.

    Returns
    -------
    AttitudeRun
        The attitudes, and their errors if the true attitude is known.

    Raises
    ------
    InputError
        unknown algorithm; a record that is not uniform, has a gap, or turns by more than the algorithm takes
    """
    return motion.run_attitude(
        motion.trusted(
            records.read_record(record, records.StrapdownRecord, channels=channels, stamps=stamps), trust=trust
        ),
        algorithm=algorithm,
        rates=rates,
        rate_divisor=rate_divisor,
        bridge_gaps=bridge_gaps,
        gyro_bias=gyro_bias,
        out=out,
        progress=progress,
    )


@keeping
def calibrate(
    record: "records.Source",
    *,
    noise_bound: NoiseBound = None,
    noise_sd: NoiseSd = None,
    noise_result: NoiseResult = None,
    gravity: Gravity = 9.80665,
    convention: Convention = "A1",
    baseline: Baseline = "asymmetric",
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    without: Without = "",
    targets: Targets = (),
    priors: Sequence[str] = (),
    explained_by: ExplainedBy = None,
    bench: "calibrations.BenchOnEarth | None" = None,
    rates: Rates = "instantaneous",
    rest_scatter: RestScatter = None,
    rests: RestsFile = None,
    faces: Faces = None,
    turns: Turns = None,
) -> "calibrations.Calibration":
    """Estimate the parameters of an instrument by any record: values with errors, open parameters, verdict.

    On a table the errors are guaranteed. Without one, the norm of gravity calibrates accelerometers in any poses, and
    the moves between these the gyros.

    Parameters
    ----------
    record : path, table in memory, record or Simulation
        Position record, raw record or bench record; strapdown record, accelerometer record or pose record.
    priors : sequence of str
        Prior knowledge: X16=1e-3 for |X16| <= 1e-3, or 'bounds' for all by --bounds. Repeat it for several.
    bench : Bench, optional
        Of a bench record, where it was measured and how well its encoders tell angles: then its gyros are calibrated
        too. By default those of its comment lines.

    Returns
    -------
    Calibration
        Verdict, estimates with error bounds, and exact intervals.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> run = th.simulate("scenarios/static-calibration.toml")
    >>> th.calibrate(run, noise_bound=1e-5).verdict
    'consistent'
    """
    run = records.read_record(record, *records.TO_CALIBRATE, channels=channels, stamps=stamps, without=without)
    remarks: list[str] = []
    if explained_by is not None:
        explained_by = _diagnosis_of(explained_by)
        if not diagnosis.explanations_to_use(explained_by, noise_bound):
            remarks = [diagnosis.without_explanation(explained_by)]
            if noise_bound is None and noise_sd is None and noise_result is None:
                noise_bound = explained_by.given_bound
            explained_by = None
    of_hand = {"rest_scatter": rest_scatter, "rests": rests, "faces": faces, "turns": turns}
    if isinstance(run, records.StrapdownRecord) and explained_by is not None:
        of_table = {"bench": bench, "target": tuple(targets), "prior": tuple(priors), **of_hand}
        _refuse(of_table, run, "a record of a table")
        run = motion.trusted(run, trust=trust, gravity=gravity)
        known = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity, "rates": rates}
        return diagnosis.calibrated_with(explained_by, run, **known).model_copy(update={"made_of": run})
    if not isinstance(run, records.PositionRecord):
        of_table = {
            "bench": bench,
            "with": explained_by,
            "target": tuple(targets),
            "prior": tuple(priors),
            "noise": noise_result,
        }
        of_table |= {"convention": convention != "A1", "baseline": baseline != "asymmetric"}
        of_table |= {"bounds": tuple(bounds) != (3e-3, 1e-2), "mounting": mounting != "identity"}
        _refuse(of_table, run, "a record of a table")
        run = _trusted_in_parts(run, trust=trust, moves=False, gravity=gravity)
        run = replace(run, warnings=(*remarks, *run.warnings))
        known = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity, "rates": rates}
        result = by_hand.calibrate_by_hand(run, by_hand.HandRequest.told(**known, **of_hand))
        return result.model_copy(update={"made_of": run})
    _refuse(of_hand, run, "a record without a table")
    noise_sd = _deviation(run, noise_result, noise_bound, noise_sd)
    place = calibrations.BenchOnEarth.given(run, **({} if bench is None else vars(bench)))
    if explained_by is not None and bench is None and (targets or priors or convention != "A1"):
        # These are of readings at rest; nobody asked for the gyros.
        place = None
    run = motion.trusted(run, trust=trust, gyros=place is not None, gravity=gravity)
    options = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity, "convention": convention}
    options |= {"baseline": baseline, "bounds": bounds, "mounting": mounting, "targets": targets, "priors": priors}
    if explained_by is None:
        run = replace(run, warnings=(*remarks, *run.warnings))
        return calibrations.calibrate_whole(run, place, **options).model_copy(update={"made_of": run})
    return diagnosis.calibrated_with(explained_by, run, place, **options).model_copy(update={"made_of": run})


def _trusted_in_parts(run: Any, *, trust: bool, gravity: float, moves: bool = True) -> Any:
    """Return a record with what speaks against it among its warnings; sections cut together are judged each by itself.

    Raises InputError for faults, as `motion.trusted`.
    """
    checked = motion.trusted(by_hand.parted_at_cuts(run, gravity), trust=trust, moves=moves, gravity=gravity)
    return replace(run, warnings=checked.warnings)


def _refuse(options: Mapping[str, Any], run: "records.Record", kind: str) -> None:
    """Refuse the first option that was given and is of another kind of record."""
    for name, value in options.items():
        if value not in (None, False, ()):
            raise InputError(f"--{name.replace('_', '-')}: is of {kind}; {run.path} is no such record")


def _deviation(
    record: "records.PositionRecord | records.StrapdownRecord",
    noise_result: NoiseResult,
    noise_bound: float | None,
    noise_sd: float | None,
) -> float | None:
    """Return the standard deviation of averaged readings as given, or by a noise result; None where neither is given.

    Raises InputError where σ is given twice, or the record is not of positions.
    """
    if noise_result is None:
        return noise_sd
    if noise_bound is not None or noise_sd is not None:
        raise InputError("--noise: σ is given twice; leave out --noise-bound and --noise-sd")
    if not isinstance(record, records.PositionRecord):
        raise InputError(f"--noise: {record.path} is a strapdown record, which tells its own bounds; leave it out")
    return noises.deviation_for(noise_result, record)


def _diagnosis_of(found: "str | Path | Any") -> "diagnosis.Diagnosis":
    """Return a diagnosis, or that of a file.

    Raises InputError for another result.
    """
    result = diagnosis.read_diagnosis(Path(found)) if isinstance(found, str | Path) else found
    if not isinstance(result, diagnosis.Diagnosis):
        what = found if isinstance(found, str | Path) else type(found).__name__
        raise InputError(f"--with {what}: is not a diagnosis; the file of `trihedron diagnose --json` is needed")
    return result


def bench_at(
    record: "records.PositionRecord | records.StrapdownRecord",
    *,
    latitude_deg: float | None = None,
    azimuth_deg: float | None = None,
    gyro_noise: float | None = None,
    encoder_bound: float | None = None,
    rates: Rates = "instantaneous",
) -> "calibrations.BenchOnEarth | None":
    """Return the place of a bench and the accuracy of its turns; None if nothing is given.

    Parameters
    ----------
    record : record
        Its comment lines give the values that are None here.
    latitude_deg : float, optional
        Latitude of the bench [deg]. Default: the record's comment line. With --azimuth-deg the gyros are calibrated,
        too.
    azimuth_deg : float, optional
        Azimuth of the bench's outer axis, from north towards east [deg]. Default: the record's comment line.
    gyro_noise : float, optional
        Bound of a gyro's mean noise over one second [rad/s]; it falls as 1/√T. Default: from the rests.
    encoder_bound : float, optional
        Bound of an encoder's error [rad]. Default: σ, which includes it.
    rates : str
        Meaning of a rate in a bench record: of the instant, or the average since the last row.

    Returns
    -------
    Bench or None
        The place and the bounds.

    Raises
    ------
    InputError
        a number out of range, one without the place, or a place that is not the record's own
    """
    return calibrations.BenchOnEarth.given(
        record,
        latitude_deg=latitude_deg,
        azimuth_deg=azimuth_deg,
        gyro_noise=gyro_noise,
        encoder_bound=encoder_bound,
        rates=rates,
    )


def diagnose(
    record: "records.Source",
    *,
    noise_bound: NoiseBound = None,
    noise_sd: NoiseSd = None,
    noise_result: NoiseResult = None,
    gravity: Gravity = 9.80665,
    baseline: RecordBaseline = None,
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    without: Without = "",
    rates: Rates = "instantaneous",
    reference_bound: ReferenceBound = None,
    hypotheses: Sequence[str] = (),
    effects_from: EffectsFrom = None,
    extend: Extend = False,
    bench: "calibrations.BenchOnEarth | None" = None,
    against: str | Path | None = None,
    progress: Progress = False,
) -> "diagnosis.Diagnosis":
    """Decide whether the simulation can explain a record; if not, name the missing effect.

    Parameters
    ----------
    record : path, table in memory, record or Simulation
        Position record, raw record, bench record or strapdown record, CSV or Parquet.
    noise_bound : float, optional
        σ: bound of the error of one averaged reading, as a fraction of g. Three standard deviations fit 100 positions.
        Without it and --noise-sd, the record must give it. A strapdown record gives its own bounds.
    rates : str
        Meaning of a rate: of the instant, or the average since the last row.
    hypotheses : sequence of str
        Formula to test as the missing effect, as "f2 += c*sin(3*alpha)". Letters are unknown coefficients. Repeat it
        for several.
    bench : Bench, optional
        Of a bench record, where it was measured and how well its encoders tell angles: then its gyros are held against
        the table, too.
    against : path, optional
        A scenario (TOML): the record's noise is held against that of its blocks. A rest of five minutes is needed.

    Returns
    -------
    Diagnosis
        Verdict, and the causes with their intervals.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> th.diagnose("measured.csv", noise_bound=1e-5)  # doctest: +SKIP
    """
    reading = {"channels": channels, "stamps": stamps, "without": without}
    run = records.read_record(record, records.PositionRecord, records.StrapdownRecord, **reading)
    noise_sd = _deviation(run, noise_result, noise_bound, noise_sd)
    place = calibrations.BenchOnEarth.given(run, **({} if bench is None else vars(bench)))
    is_table = isinstance(run, records.PositionRecord)
    run = motion.trusted(run, trust=trust, gyros=not is_table or place is not None, gravity=gravity)
    options = diagnosis.evidence_options(
        run,
        bench=place,
        noise_bound=noise_bound,
        noise_sd=noise_sd,
        gravity=gravity,
        baseline=baseline,
        bounds=bounds,
        mounting=mounting,
        rates=rates,
        reference_bound=reference_bound,
    )
    with own_effects.with_effects_of(effects_from):
        result = diagnosis.diagnose(run, hypotheses=hypotheses, extend=extend, progress=progress, **options)
    if against is None:
        return result.model_copy(update={"made_of": run})
    return result.model_copy(update={"made_of": run, "noise": _noise_against(run, against, gravity)})


def _noise_against(
    run: "records.PositionRecord | records.StrapdownRecord", against: str | Path, gravity: float
) -> "noises.Noise":
    """Return the noise of a record's rests against that of a scenario.

    Raises
    ------
    InputError
        for a table of positions, or rests that are too short
    """
    series = run.raw if isinstance(run, records.PositionRecord) else run
    if series is None:
        raise InputError(f"--against {against}: {run.path} has no readings in time; give a raw or strapdown record")
    result = noises.identify([series], gravity=gravity, scenario=orchestrator.read_scenario(against))
    if result.too_short_for:
        raise InputError(
            f"--against {against}: no rest of {run.path} is long enough for noise; record the block at rest for "
            "five minutes or more, best for an hour"
        )
    return result


# Several records of one instrument


def calibrate_together(
    first: "records.Source",
    /,
    *others: "records.Source",
    noise_bound: NoiseBound = None,
    noise_sd: NoiseSd = None,
    gravity: Gravity = 9.80665,
    baseline: Baseline = "asymmetric",
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    shared: Shared = (),
    own: Own = (),
    rest_scatter: RestScatter = None,
) -> "calibrations.Calibration":
    """Calibrate several records of one instrument in one programme: its scale factors and misalignments have one value.

    Parameters
    ----------
    first, others : path, table in memory or record
        Records of a table (positions or raw), without one, or of both kinds, two at least. Of both, those of a table
        count by the norm of gravity, without its angles and gyros.

    Returns
    -------
    Calibration
        Parameters of the instrument, and those of each record.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line
    """
    runs = _several((first, *others), records.TO_CALIBRATE, channels, stamps)
    of_table = [isinstance(run, records.PositionRecord) for run in runs.values()]
    if not all(of_table):
        refused = {"baseline": baseline != "asymmetric", "bounds": tuple(bounds) != (3e-3, 1e-2)}
        refused |= {"mounting": mounting != "identity"}
        for label, run in runs.items():
            _refuse(refused, run, "records of a table")
            if isinstance(run, records.PositionRecord):
                run = replace(run.poses, warnings=(*run.warnings, NORM_ALONE))
            runs[label] = _trusted_in_parts(run, trust=trust, moves=False, gravity=gravity)
        request = by_hand.HandRequest(
            noise_bound=noise_bound, noise_sd=noise_sd, gravity=gravity, rest_scatter=rest_scatter
        )
        return by_hand.calibrate_runs_by_hand(runs, request, shared, own)
    for run in runs.values():
        _refuse({"rest_scatter": rest_scatter}, run, "records without a table")
        if noise_bound is None and noise_sd is None and not records.tells_noise(run):
            raise InputError(f"{run.path}: does not tell its noise bound; {calibrations.SAY_THE_NOISE}")
    options = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity, "baseline": baseline}
    options |= {"bounds": bounds, "mounting": mounting}
    evidence, digests, warnings = {}, [], list[str]()
    for label, run in runs.items():
        run = motion.trusted(run, trust=trust, gyros=False, gravity=gravity)
        warnings += [f"{label}: {line}" for line in run.warnings]
        evidence[label] = diagnosis.evidence_of(run, **diagnosis.evidence_options(run, among=runs, **options))
        digests.append(run.sha256)
    result = diagnosis.calibrated_together(evidence, shared=shared, own=own, sha256=digests)
    return result.model_copy(update={"warnings": [*warnings, *result.warnings]})


def diagnose_together(
    first: "records.Source",
    /,
    *others: "records.Source",
    noise_bound: NoiseBound = None,
    noise_sd: NoiseSd = None,
    gravity: Gravity = 9.80665,
    baseline: RecordBaseline = None,
    bounds: Bounds = (3e-3, 1e-2),
    mounting: Mounting = "identity",
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
    rates: Rates = "instantaneous",
    reference_bound: ReferenceBound = None,
    effects_from: EffectsFrom = None,
    extend: Extend = False,
    shared: Shared = (),
    own: Own = (),
    progress: Progress = False,
) -> "diagnosis.Diagnosis":
    """Diagnose several records of one instrument: separate their common effects from those of one run.

    Each is diagnosed by itself; then all together, with one value for each parameter of the instrument. Then the
    smallest set of effects is searched that explains all records: effects of all or of one, and parameters that differ
    in one. All records have the same options; an option for one kind of record applies only to that kind.

    Parameters
    ----------
    first, others : path, table in memory or record
        Records of one instrument, of positions (or raw), strapdown, or some of both, two at least. Files are called by
        their names, others by their numbers.

    Returns
    -------
    Diagnosis
        Verdict, common causes, and causes of single records.

    Raises
    ------
    InputError
        for anything that cannot be done, in one line

    Examples
    --------
    >>> import trihedron as th
    >>> th.diagnose_together("monday.csv", "tuesday.csv", "friday.csv", noise_bound=1e-5)  # doctest: +SKIP
    """
    runs = _several((first, *others), (records.PositionRecord, records.StrapdownRecord), channels, stamps)
    for label, run in runs.items():
        is_table = isinstance(run, records.PositionRecord)
        runs[label] = motion.trusted(run, trust=trust, gyros=not is_table, gravity=gravity)
    diagnosis.check_room(*runs.values())
    options = {"noise_bound": noise_bound, "noise_sd": noise_sd, "gravity": gravity, "baseline": baseline}
    options |= {"bounds": bounds, "mounting": mounting, "rates": rates, "reference_bound": reference_bound}
    with own_effects.with_effects_of(effects_from):
        single = {}
        for label, run in runs.items():
            single[label] = diagnosis.evidence_of(run, **diagnosis.evidence_options(run, among=runs, **options))
        evidence = diagnosis.members_of(single, shared, own)
        alone, unsure, digests = {}, {}, {}
        for label, run in runs.items():
            alone[label] = diagnosis.diagnose(run, evidence=evidence[label], extend=extend, progress=progress)
            digests[label] = run.sha256
            tells = not isinstance(run, records.PositionRecord) or records.tells_noise(run)
            if noise_bound is None and noise_sd is None and not tells:
                unsure[label] = (
                    "its noise bound is the scatter within rests, which falsifies nothing: give --noise-sd, or "
                    "--noise-bound"
                )
        return diagnosis.diagnosed_together(
            alone, shared=shared, own=own, left_out=unsure, sha256=digests, progress=progress
        )


def _several(
    sources: Sequence["records.Source"], kinds: tuple[type, ...], channels: Sequence[str], stamps: str | None
) -> dict[str, Any]:
    """Return several records by label.

    Raises InputError for fewer than two, and for one that is given twice.
    """
    if len(sources) < 2:
        raise InputError("several records are needed, two at least")
    runs = [records.read_record(source, *kinds, channels=channels, stamps=stamps) for source in sources]
    digests = set()
    for run in runs:
        if run.sha256 and run.sha256 in digests:
            raise InputError(f"{run.path}: is given twice")
        digests.add(run.sha256)
    return dict(zip(diagnosis.labels_of([run.path for run in runs]), runs, strict=True))
