"""What was measured on a bench, what proves its model false, what to measure next; what results rest on."""

import sys
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...fmus import version
from ..calibration import Calibration
from ..calibration.estimates import chebyshev_centre
from ..calibration.model import Linearisation
from ..diagnosis.result import Diagnosis
from ..document.blocks import Download, Section, Table
from ..document.numbers import Cell, Written, minus, typeset
from ..records import PositionRecord
from .pictures.records import bench_tour, next_directions

LIBRARIES = ("numpy", "scipy", "highspy", "fmpy")


VERDICTS = {
    "consistent": "consistent: the model explains the record within the noise bound",
    "falsified": "falsified: no parameters of the model keep every reading within the noise bound",
    "insufficient": "insufficient: the record cannot determine everything that is asked",
    "explained": "explained: a smallest set of effects makes the model consistent, and no other does",
    "ambiguous": "ambiguous: several sets of effects would make the model consistent",
    "unexplained": "unexplained: the model is falsified and nothing in the catalogue mends it",
}


def of_bench(result: Diagnosis) -> bool:
    """Whether the evidence is rests on a table, and not a block that was carried."""
    return result.unit is None


def measured_section(record: PositionRecord, result: Calibration) -> Section:
    """The record in words, and where on the sphere it has measured."""
    seconds = float(np.ptp(record.time_s))
    lasted = f"{seconds:.0f} seconds" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"
    said = [
        f"{len(record)} positions of the table within {lasted}, three accelerometers at each; "
        f"{result.measurements} readings are used."
    ]
    if record.raw is not None:
        found = len(record.rests)
        said.append(
            f"They are averages of the rests that were found in a time series: {found}, of which {len(record)}."
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


def run_section(table: pl.DataFrame, gravity: float, files: list[Path]) -> Section:
    """The position programme that a simulated bench carried out."""
    readings = np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1) / gravity
    return Section(
        "The bench, simulated",
        [
            "Three FMUs, coupled by the orchestrator: the table carries the block through its positions for "
            f"{float(table['time_s'][-1]):.0f} s, the block reads, the attitude computer follows the increments."
        ],
        bench_tour(table["time_s"], (table["alpha_deg"], table["beta_deg"]), readings),
        "Angles of the two axes and readings of the three accelerometers.",
        files=files,
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


def proved(result: Calibration, numbers: NDArray) -> NDArray:
    """Readings (N, 3) of bool that prove a falsification; `numbers` are the record's own of its rows."""
    witness = {(reading.position, reading.accelerometer) for reading in result.witness}
    return np.array([[(int(number), p) in witness for p in (1, 2, 3)] for number in numbers]).reshape(-1, 3)


def centre_residual(result: Calibration) -> NDArray:
    """Residuals (N, 3) [g] where the largest of them, in units of its bound, is least."""
    here = result.linearised
    return here.residual_at(chebyshev_centre(here)[1]).reshape(-1, 3)


def proof_lines(result: Calibration) -> list[str]:
    """The measurements that prove a falsification."""
    shown = ", ".join(f"{reading.position}/{reading.accelerometer}" for reading in result.witness)
    return [f"proved by position/accelerometer: {shown}"] if shown else []


def proof_section(result: Calibration, numbers: NDArray) -> Section | None:
    """The readings that prove that no parameters fit."""
    if not result.witness:
        return None
    here = result.linearised
    left = centre_residual(result) / here.bound.reshape(-1, 3)
    rows: list[list[Cell]] = []
    for i, axis in np.argwhere(proved(result, numbers)):
        angles = (f"{np.degrees(angle[i]):.4f}" for angle in (here.positions.alpha, here.positions.beta))
        figures = (*angles, f"{here.input[i, axis]:.3f}", f"{left[i, axis]:+.2f}")
        rows.append([int(numbers[i]), int(axis) + 1, *(Written(minus(figure)) for figure in figures)])
    header = ["position", "accelerometer", "α [deg]", "β [deg]", "its input [g]", "at best off by [σ]"]
    return Section(
        "Evidence: the readings that prove it",
        [
            f"These {len(result.witness)} readings alone, whatever the others are, cannot all be within "
            f"{result.radius:.3g} σ of any parameters' prediction. If one of them is known to be spoilt, leave its "
            "row out and look again."
        ],
        table=Table(header, rows),
    )


OPTIONAL = ("mounting", "approach_alpha", "approach_beta")
MOST_LABELS = 24
"""Up to so many positions are numbered in the picture."""
SENSES = {1: "forwards", -1: "backwards"}


def position_text(position: Mapping[str, Any]) -> str:
    """A proposed table position."""
    text = f"alpha {position['alpha_deg']:g}°, beta {position['beta_deg']:g}°"
    if "mounting" in position:
        text += f", mounting {position['mounting']}"
    if "approach_alpha" in position:
        text += f", approached {SENSES[position['approach_alpha']]} in alpha, "
        text += f"{SENSES[position['approach_beta']]} in beta"
    if position.get("separates"):
        text += f" (separates {', '.join(position['separates'])})"
    return text


def next_positions_csv(positions: Sequence[Mapping[str, Any]]) -> str:
    """Positions as CSV: their number, both angles [deg], and mounting and senses of the approach where they matter."""
    names = ["position", "alpha_deg", "beta_deg", *(name for name in OPTIONAL if any(name in p for p in positions))]
    rows = [
        ",".join([str(k), *(str(position.get(name, "")) for name in names[1:])])
        for k, position in enumerate(positions, start=1)
    ]
    return "\n".join([",".join(names), *rows, ""])


def next_section(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> Section | None:
    """The proposed positions on the sphere, as a table and as a file."""
    if not positions:
        return None
    alpha, beta = (np.radians([float(p[name]) for p in positions]) for name in ("alpha_deg", "beta_deg"))
    separates = any(p.get("separates") for p in positions)
    rows: list[list[Cell]] = []
    for k, p in enumerate(positions, start=1):
        angles = (Written(minus(f"{float(p[name]):g}")) for name in ("alpha_deg", "beta_deg"))
        how = (SENSES.get(p[name], str(p[name])) if name in p else None for name in OPTIONAL)
        apart = p.get("apart_g")
        told = None if apart is None else Written(f"{max(apart, 0.0) / sigma(here) + 0.0:.2g}")
        rows.append([k, *angles, *how, ", ".join(p.get("separates", ())) if separates else None, told])
    said = ["Readings at these positions besides would determine what is open."]
    if separates:
        sure = len(deciding(here, positions))
        said = [
            "Predictions of the two candidates that a position is for differ there, or at another of the positions for "
            "the same two, by at least the last column, whatever their parameters. More than 2 σ decides between them "
            f"in any noise: {sure or 'none'} of {len(positions)} positions do."
        ]
    labels = [str(k) for k in range(1, len(positions) + 1)] if len(positions) <= MOST_LABELS else [""]
    header = ["no.", "α [deg]", "β [deg]", "mounting", "α turned", "β turned", "tells apart", "by [σ]"]
    file = "next-positions.csv"
    return Section(
        "Where to measure next",
        said,
        next_directions(here.positions.alpha, here.positions.beta, alpha, beta, labels),
        "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
        Table(header, rows).told(),
        download=Download(file, next_positions_csv(positions), f"{file}, to take to the table"),
    )


def deciding(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The positions at which two candidates surely differ."""
    return [p for p in positions if p.get("apart_g") is not None and p["apart_g"] > 2.0 * sigma(here)]


def sigma(here: Linearisation) -> float:
    """σ as a fraction of g."""
    return float(here.bound.min())


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
        given[f"mounting {name}"] = matrix_text(np.asarray(matrix).tolist())
    for prior in result.priors:
        given[f"known beforehand, {prior.expression}"] = f"at most {prior.limit:g}"
    return given | dict(more or {}) | versions()


def matrix_text(matrix: Sequence[Sequence[float]]) -> str:
    """A matrix in a line."""
    return minus("; ".join(" ".join(f"{value:.6g}" for value in row) for row in matrix))


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


def cited(*names: str | Any) -> list[str]:
    """The sources of some methods; what is false is passed over."""
    return [SOURCES[name] for name in names if name]


def calibration_sources(result: Calibration) -> list[str]:
    """Of a calibration."""
    falsified, allan = result.verdict == "falsified", "Allan" in result.noise_bound_basis
    return cited("guaranteed", "simplex", falsified and "chebyshev", allan and "allan")


def diagnosis_sources(result: Diagnosis) -> list[str]:
    """Of a diagnosis, whatever the record."""
    own = result.witness
    if of_bench(result):
        first = calibration_sources(result.evidence.calibration)
        shuffled, left_out = own and own.shuffles, own and (own.folds or own.blocks)
        gained = result.gain
    else:
        found, carried = result.evidence.found, bool(result.evidence.parts)
        norm = found.accelerometers is not None and found.accelerometers.least_squares is not None
        first = cited(norm and "norm", found.gyros is not None and "allan")
        first += cited("gyros", "attitude", "simplex", result.tried and "chebyshev") if carried else []
        shuffled = left_out = result.judgement
        gained = carried
    return [
        *first,
        *cited(
            result.tried and "lawson",
            len(result.tried) > 1 and "angles",
            shuffled and "shuffles",
            left_out and "left-out",
            gained and "fmi",
        ),
    ]
