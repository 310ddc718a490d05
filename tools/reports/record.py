"""What was measured, what a result rests on, and where its methods are published."""

import math
import sys
from collections.abc import Mapping
from importlib import metadata

import numpy as np

from ...fmus import version
from ..calibration import Calibration
from ..diagnosis.result import Diagnosis
from ..document.blocks import Section, Table
from ..document.numbers import Cell, Written, minus, outwards, significant, to_bound, typeset, unit_text, upwards
from ..motion.inspect import EXCITED, GyrosAtRest, Inspection
from ..motion.norm import NAMES, NormCalibration
from ..records import PositionRecord
from .model import own_words
from .pictures.residuals import next_directions
from .pictures.time import allan_picture
from .words import parameters_of

LIBRARIES = ("numpy", "scipy", "highspy", "fmpy")


def measured_section(record: PositionRecord, result: Calibration, *, rests: int | None = None) -> Section:
    """The record in words, and where on the sphere it has measured."""
    seconds = float(np.ptp(record.time_s))
    lasted = f"{seconds:.0f} seconds" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"
    said = [
        f"{len(record)} positions of the table within {lasted}, three accelerometers at each; "
        f"{result.measurements} readings are used."
    ]
    if rests is not None:
        said.append(
            f"They are averages of the rests that were found in a time series: {rests}, of which {len(record)}."
        )
    known = []
    if record.temperature is not None:
        low, high = float(record.temperature.min()), float(record.temperature.max())
        known.append(f"temperature {low:.1f} to {high:.1f} °C" if high - low >= 0.05 else f"temperature {low:.1f} °C")
    if record.approach_alpha is not None:
        known.append("the senses in which the positions were approached")
    if record.mounting is not None:
        known.append(f"the mountings {', '.join(dict.fromkeys(record.mounting))}")
    if known:
        said.append(f"Known besides: {'; '.join(known)}.")
    said.append(f"Errors of averaged readings are taken to be within σ = {result.noise_bound:.3g} g ({basis(result)}).")
    said += [f"Warning: {warning}." for warning in result.warnings]
    return Section(
        "What was measured",
        said,
        next_directions(record.alpha, record.beta, [], []),
        "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
    )


def basis(result: Calibration) -> str:
    """On what the noise bound rests, in words."""
    return "as given" if result.noise_bound_basis == "given" else result.noise_bound_basis


def key_figures(result: Calibration) -> dict[str, object]:
    """What stands below the verdict."""
    return {
        "positions": result.positions,
        "readings": result.measurements,
        "noise bound σ": f"{result.noise_bound:.3g} g",
        "least largest residual": f"{result.radius:.3g} σ",
    }


def provenance(result: Calibration, more: Mapping[str, object] | None = None) -> dict[str, object]:
    """What a result rests on: record, options, versions; the same inputs give the same page."""
    p = result.linearised.parametrisation
    given: dict[str, object] = {}
    if result.provenance is not None:
        given["record"] = result.provenance.record
        if result.provenance.sha256:
            given["record, SHA-256"] = result.provenance.sha256
    given["noise bound"] = typeset(f"{result.noise_bound:.6g} g, {basis(result)}")
    given["gravity"] = f"{result.gravity:.8g} m/s²"
    given["model"] = f"{result.baseline} scale factors, convention {result.convention}"
    if result.provenance is not None:
        u, v = result.provenance.bounds
        given["bounds of (1.7)"] = f"u = {u:g}, v = {v:g}"
    for name, matrix in zip(p.mountings, p.matrices, strict=True):
        rows = "; ".join(" ".join(f"{value:.6g}" for value in row) for row in np.asarray(matrix))
        given[f"mounting {name}"] = minus(rows)
    for prior in result.priors:
        given[f"known beforehand, {prior.expression}"] = f"at most {prior.limit:g}"
    return given | dict(more or {}) | versions()


def versions() -> dict[str, object]:
    """Of the program and of what it computes with."""
    python = ".".join(str(part) for part in sys.version_info[:3])
    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in LIBRARIES)
    return {"trihedron": version(), "computed with": f"Python {python}, {libraries}"}


SOURCES = {
    "guaranteed": (
        "Model of bench and block, targets, guaranteed estimates: A. A. Golovan, A. I. Matasov, I. E. Tarygin. "
        "Calibration of an accelerometer block with asymmetric models of its sensors. Izvestiya RAN, Teoriya i sistemy "
        "upravleniya, 2022, no. 2, pp. 107–119 (in Russian)."
    ),
    "simplex": (
        "Linear programmes, by HiGHS: Q. Huangfu, J. A. J. Hall. Parallelizing the dual revised simplex method. "
        "Mathematical Programming Computation 10 (2018), pp. 119–142. doi 10.1007/s12532-017-0130-5."
    ),
    "chebyshev": (
        "Least largest residual, and the few readings that decide it: E. W. Cheney. Introduction to Approximation "
        "Theory. McGraw-Hill, 1966, chapter 2."
    ),
    "lawson": (
        "Sets of effects refused by weighted least squares: C. L. Lawson. Contributions to the theory of linear least "
        "maximum approximation. Thesis, University of California, Los Angeles, 1961."
    ),
    "allan": (
        "Noise from the scatter within rests: D. W. Allan. Statistics of atomic frequency standards. Proceedings "
        "of the IEEE 54 (1966), pp. 221–230. doi 10.1109/PROC.1966.4634."
    ),
    "left-out": (
        "Parts of the record left out and predicted: M. Stone. Cross-validatory choice and assessment of statistical "
        "predictions. Journal of the Royal Statistical Society B 36 (1974), pp. 111–147."
    ),
    "angles": (
        "What could be taken for what, by angles between subspaces: Å. Björck, G. H. Golub. Numerical methods for "
        "computing angles between linear subspaces. Mathematics of Computation 27 (1973), pp. 579–594."
    ),
    "gyros": (
        "Model of the gyro block: P. Groves. Principles of GNSS, inertial, and multisensor integrated navigation "
        "systems. 2nd edition, Artech House, 2013, section 4.4."
    ),
    "attitude": (
        "Attitude from increments: Yu. N. Chelnokov, S. E. Perelyaev, L. A. Chelnokova. Investigation of algorithms "
        "for the inertial orientation of a moving object. Izvestiya of Saratov University, Mathematics. Mechanics. "
        "Informatics 16 (2016), no. 1, pp. 80–95 (in Russian). doi 10.18500/1816-9791-2016-16-1-80-95."
    ),
    "norm": (
        "Accelerometers by the size of gravity at rest: J. C. Lötters, J. Schipper, P. H. Veltink, W. Olthuis, "
        "P. Bergveld. Procedure for in-use calibration of triaxial accelerometers in medical applications. Sensors and "
        "Actuators A 68 (1998), pp. 221–228."
    ),
    "shuffles": "Shuffled effects as a control: R. A. Fisher. The Design of Experiments. Oliver and Boyd, 1935.",
    "fmi": (
        "Simulation by FMUs: Modelica Association. Functional Mock-up Interface for Model Exchange and "
        "Co-Simulation, version 2.0. 2014."
    ),
    "columns": (
        "Optimal plans by generated columns: P. C. Gilmore, R. E. Gomory. A linear programming approach to the "
        "cutting-stock problem. Operations Research 9 (1961), pp. 849–859. doi 10.1287/opre.9.6.849."
    ),
    "branches": (
        "Proof that no plan is better: A. H. Land, A. G. Doig. An automatic method of solving discrete programming "
        "problems. Econometrica 28 (1960), pp. 497–520. doi 10.2307/1910129."
    ),
}
"""Methods, each with what it does here and where it is from."""


def calibration_sources(result: Calibration) -> list[str]:
    """Of a calibration."""
    used = ["guaranteed", "simplex"]
    if result.verdict == "falsified":
        used.append("chebyshev")
    if "Allan" in result.noise_bound_basis:
        used.append("allan")
    return [SOURCES[name] for name in used]


def diagnosis_sources(result: Diagnosis, *, compared: bool) -> list[str]:
    """Of a diagnosis; `compared` where it is shown how alike effects are."""
    used = []
    if result.tried:
        used.append("lawson")
    if result.witness is not None and result.witness.shuffles:
        used.append("shuffles")
    if result.witness is not None and (result.witness.folds or result.witness.blocks):
        used.append("left-out")
    if result.gain is not None:
        used.append("fmi")
    if compared:
        used.append("angles")
    return [*calibration_sources(result.evidence.calibration), *(SOURCES[name] for name in used)]


def strapdown_sources(result: Diagnosis) -> list[str]:
    """Of the diagnosis of a strapdown record."""
    used = []
    found = result.evidence.found
    if found.accelerometers is not None and found.accelerometers.least_squares is not None:
        used.append("norm")
    if found.gyros is not None:
        used.append("allan")
    if result.evidence.parts:
        used += ["gyros", "attitude", "fmi", "simplex"]
    if result.tried:
        used += ["chebyshev", "lawson"]
    if len(result.tried) > 1:
        used.append("angles")
    if result.judgement:
        used += ["shuffles", "left-out"]
    return [SOURCES[name] for name in used]


def plan_sources(*, proven: bool) -> list[str]:
    """Of optimal plans; `proven` over all angles."""
    return [SOURCES[name] for name in ("guaranteed", "simplex", "columns", *(("branches",) if proven else ()))]


def common_plan_sources() -> list[str]:
    """Of one set of positions for all targets."""
    return [SOURCES[name] for name in ("guaranteed", "simplex")]


EVEN = 1e-6
"""Time stamps that stray by less than so much of a period are called even."""
GYROS = {
    "constant": "At rest the gyros read a constant, as far as their noise tells.",
    "named": "At rest the gyros' means are not constant: one smallest model stands, {}.",
    "ambiguous": "At rest the gyros' means are not constant, and several models stand: {}.",
    "wandering": "At rest the gyros' means are not constant, and nothing that was tried explains it.",
    "insufficient": "There are too few rests to say how the gyros' means change.",
}


def measured_sections(result: Diagnosis) -> list[Section]:
    """The record, and what its rests say of accelerometers and gyros."""
    found = result.evidence.found
    first = Section(
        "What was measured",
        [sampling_words(found), *rest_words(found), *(f"Warning: {text}." for text in result.warnings)],
        allan_picture(found.record, found.rests, found.sampling.period),
        "Allan deviation of the readings over the rests: what noise leaves of a mean of that length.",
    )
    # Where gravity is the reference the accelerometers stand among the block's own parameters, better known.
    accelerometers = (
        None if any(p.name.startswith("accelerometer") for p in parameters_of(result)) else found.accelerometers
    )
    sections = [] if accelerometers is None else [accelerometer_section(accelerometers, told=bool(result.missing))]
    return [first, *sections, *([] if found.gyros is None else [gyro_section(found.gyros)])]


def sampling_words(found: Inspection) -> str:
    """Rows, sampling, and what else the record has."""
    record, sampling = found.record, found.sampling
    kind = "rates" if record.rate is not None else "increments"
    length = float(record.time_s[-1] - record.time_s[0])
    lasted = f"{length:.0f} seconds" if length < 120.0 else f"{length / 60.0:.0f} minutes"
    said = f"{len(record)} rows of {kind} and specific forces within {lasted}, one every {sampling.period:.6g} s"
    if sampling.jitter_max > EVEN * sampling.period:
        said += f"; the time stamps stray by {sampling.jitter_rms:.2g} s rms, {sampling.jitter_max:.2g} s at most"
    if sampling.gaps:
        said += f"; {len(sampling.gaps)} gaps, {sampling.missing} rows missing"
    there = {"the temperature": record.temperature is not None, "the true attitude": record.attitude is not None}
    known = " and ".join(name for name, present in there.items() if present)
    return f"{said}. Known besides: {known}." if known else f"{said}."


def rest_words(found: Inspection) -> list[str]:
    """Rests, moves, excitation, and what noise leaves of a mean at rest."""
    rests = found.rests
    if not len(rests):
        return ["There are no rests: neither gyros nor accelerometers can be judged at rest."]
    lengths = np.array([(r.stop - r.start) * found.sampling.period for r in rests.rows])
    said = f"One rest of {lengths[0]:.2g} s"
    if len(rests) > 1:
        said = f"{len(rests)} rests of {lengths.min():.2g} to {lengths.max():.2g} s, half of them up to "
        said += f"{np.median(lengths):.2g} s"
    if len(found.moves):
        turns = np.degrees([move.turn_rad for move in found.moves])
        said += f"; {len(turns)} moves between them, of {turns.min():.0f} to " if len(turns) > 1 else "; one move of "
        said += f"{turns.max():.0f} degrees"
    rates = ", ".join(f"{math.degrees(value):.3g}" for value in found.excitation)
    said += f"; rates of {rates} deg/s (root mean square) about axes 1, 2, 3 outside the rests."
    lines = [said]
    quiet = [str(p + 1) for p in range(3) if found.excitation[p] < EXCITED * rests.noise[p]]
    if quiet:
        lines.append(f"The block was not turned about axis {', '.join(quiet)}.")
    if rests.force_bound is not None and rests.rate_bound is not None:
        force, rate = np.median(rests.force_bound, axis=0).max(), np.median(rests.rate_bound, axis=0).max()
        lines.append(
            f"Noise leaves the mean of a rest known to {force / found.gravity:.2g} g and {math.degrees(rate):.2g} "
            "deg/s (three Allan deviations of its length)."
        )
    return lines


def accelerometer_section(found: NormCalibration, *, told: bool) -> Section:
    """The accelerometers calibrated by the norm of gravity; `told` where the verdict says what is missing."""
    leaves = (
        "" if found.radius is None else f", whose least possible largest residual is {found.radius:.2g} of its bound"
    )
    said = {
        "consistent": f"At every rest the size of gravity must come out. Nine parameters explain the rests{leaves}.",
        "falsified": f"At every rest the size of gravity must come out. No nine parameters explain the rests{leaves}.",
        "insufficient": "The rests do not determine the accelerometers' nine parameters.",
    }[found.verdict]
    rows: list[list[Cell]] = []
    if found.least_squares is not None and found.low is not None and found.high is not None:
        errors = np.full(len(NAMES), np.nan) if found.standard_error is None else found.standard_error
        for name, value, error, low, high in zip(
            NAMES, found.least_squares, errors, found.low, found.high, strict=True
        ):
            half = 0.5 * float(high - low)
            ends = outwards(float(low), float(high), half)
            unit = "g" if name.startswith("bias") else "1"
            row: list[Cell] = [own_words(f"accelerometer {name}"), to_bound(float(value), half)]
            rows.append([*row, upwards(float(error)), *ends, unit_text(unit)])
    header = ["parameter", "least squares", "standard error", "low", "high", "unit"]
    missing = [f"Poses that would determine them: {'; '.join(found.missing)}."] if found.missing and not told else []
    table = Table(header, rows, "Low and high hold for any errors within the bounds.") if rows else None
    return Section("Accelerometers at rest", [said, *missing], table=table)


def gyro_section(found: GyrosAtRest) -> Section:
    """What the gyros do at rest."""
    said = GYROS[found.verdict].format("; ".join(model.title for model in found.standing))
    rows: list[list[Cell]] = [
        [
            model.title,
            significant(model.radius, 3),
            "–" if model.by_chance is None else Written(f"{100.0 * model.by_chance:.0f} %"),
        ]
        for model in found.tried
    ]
    header = ["model of the means", "largest residual over its bound", "shuffled rests that do as well"]
    more = [f"Not tried: {why}." for why in found.not_tried]
    return Section("Gyros at rest", [said, *more], table=Table(header, rows) if rows else None)
