"""Functions of `import trihedron as th` that use a calibration or a diagnosis: correct readings, export for others."""

from pathlib import Path
from typing import TYPE_CHECKING

from . import calibration as calibrations
from . import check as checks
from . import diagnosis, motion, records
from . import noise as noises
from .errors import InputError
from .options import Channels, ExportTarget, Stamps, Trust

if TYPE_CHECKING:
    from numpy.typing import NDArray


def apply(
    result: "str | Path | calibrations.Calibration | diagnosis.Diagnosis",
    record: "records.Source | NDArray",
    *,
    noise_bound: float = 0.0,
    channels: Channels = (),
    stamps: Stamps = None,
    trust: Trust = False,
) -> "calibrations.Applied":
    """Correct a record by a calibration, or by the effects that a diagnosis of another record named.

    A calibration gives the equation and its worth for levelling. With a diagnosis, the effects are subtracted from the
    readings where that is possible, and the extended FMUs simulate the record without and with them.

    Parameters
    ----------
    result : path, Calibration or Diagnosis
        The result of `trihedron calibrate --json` or `trihedron diagnose --json`. With a calibration of several
        records, a new record gets the biases of the last one.
    record : path, table in memory, record or array of shape (N, 3)
        A record of any kind, CSV or Parquet. An array holds readings of the accelerometers [m/s²], for a calibration.
    noise_bound : float
        σ of the readings to correct, as a fraction of g. Default with a diagnosis: its own.

    Returns
    -------
    Applied
        The corrected record, and the errors before and after.

    Raises
    ------
    InputError
        for a calibration that lacks an estimate, a diagnosis that names nothing, or a record that cannot be used
    """
    if isinstance(result, str | Path):
        result = diagnosis.read_diagnosis(Path(result)) or result
    if not isinstance(result, diagnosis.Diagnosis):
        rows = records.record_of_array(record)
        if rows is not None:
            return calibrations.apply_calibration(result, rows, noise_bound=noise_bound)
        measured = motion.trusted(records.read_record(record, channels=channels, stamps=stamps), trust=trust)
        applied = calibrations.apply_calibration(result, measured, noise_bound=noise_bound)
        if applied.correction is None or not isinstance(measured, records.RawRecord | records.PositionRecord):
            return applied
        warnings = checks.channels_warning(applied.record, applied.correction.mounting)
        return applied.model_copy(update={"warnings": [*applied.warnings, *warnings]})
    run = records.read_record(record, records.PositionRecord, records.StrapdownRecord, channels=channels, stamps=stamps)
    run = motion.trusted(run, trust=trust)
    bound = noise_bound or None
    if bound is None and not isinstance(run, records.StrapdownRecord):
        bound = result.noise_bound
    evidence = diagnosis.evidence_of(run, **diagnosis.evidence_options(run, noise_bound=bound))
    return diagnosis.applied_to(result, run, evidence)


def correction(calibration: "str | Path | calibrations.Calibration") -> "calibrations.Correction":
    """Return the correction of a calibration: a function of arrays (N, 3), or of one reading (3,) of a stream.

    Parameters
    ----------
    calibration : path or Calibration
        The result of `trihedron calibrate --json`, of any kind of record and whatever its verdict, as long as it has
        all estimates. Of several records it has the biases of the last.

    Returns
    -------
    Correction
        `correction(readings)` gives the specific force [m/s²], `correction(readings, rates)` the angular rate [rad/s],
        too; `correction.standard_errors(readings)` gives the standard error by the calibration.

    Raises
    ------
    InputError
        for a file that is not a calibration, or lacks an estimate

    Examples
    --------
    >>> import trihedron as th
    >>> correct = th.correction("calibration.json")  # doctest: +SKIP
    >>> correct([[0.1, -0.2, 9.9]])  # doctest: +SKIP
    """
    if isinstance(calibration, str | Path):
        return calibrations.read_correction(Path(calibration))
    return calibrations.correction_of(calibration.to_json(), "calibration")


def export_calibration(
    calibration: "str | Path | calibrations.Calibration",
    to: ExportTarget,
    out: str | Path,
    *,
    noise: str | Path | None = None,
    densities: tuple[float, float, float, float] | None = None,
    rate: float | None = None,
    topic: str = "/imu0",
    name: str = "imu",
) -> "calibrations.ExportedCalibration":
    """Write a calibration for another program, with its g, units, standard errors and open directions.

    Parameters
    ----------
    calibration : path or Calibration
        The result of `trihedron calibrate --json`, of any kind of record and whatever its verdict.
    to : str
        kalibr: imu.yaml; imucal: JSON; ros: parameter file of ROS 2; c: header with two functions; matlab: .mat; csv;
        xlsx; imu_tk: a file for each triad; px4: parameters for QGroundControl.
    out : path
        The file; the gyros of imu_tk go into a second one beside it, NAME-gyros.
    noise : path, optional
        For kalibr: the result of `trihedron noise --json`.
    densities : four float, optional
        For kalibr, in place of --noise: noise density [m/s²/√Hz] and random walk [m/s³/√Hz] of the accelerometers,
        noise density [rad/s/√Hz] and random walk [rad/s²/√Hz] of the gyros.
    rate : float, optional
        For kalibr: readings per second [Hz]; by default that of --noise.
    topic : str
        For kalibr: the topic of ROS.
    name : str
        Prefix of the names in a C header; the variable in a .mat file.

    Returns
    -------
    ExportedCalibration
        The files, the equation, and the losses of the format.

    Raises
    ------
    InputError
        for a calibration without all estimates, an unknown target, missing noise densities, or a file that cannot be
        written

    Examples
    --------
    >>> import trihedron as th
    >>> th.export_calibration("calibration.json", "imucal", "imu.json")  # doctest: +SKIP
    """
    if noise is not None and densities is not None:
        raise InputError("--noise and --densities: give one of the two")
    if to != "kalibr" and (noise is not None or densities is not None or rate is not None):
        raise InputError(f"--to {to}: holds no noise; leave out --noise, --densities and --rate")
    notes = []
    if noise is not None:
        measured = noises.read_noise(noise)
        known = noises.kalibr_densities(measured)
        densities = (known[0].value, known[1].value, known[2].value, known[3].value)
        rate = measured.rate_hz if rate is None else rate
        notes = [f"{density.key}: upper end, not detected" for density in known if not density.detected]
    request = calibrations.ExportRequest(densities, rate, topic, name, tuple(notes))
    return calibrations.write_export(correction(calibration), to, Path(out), request)
