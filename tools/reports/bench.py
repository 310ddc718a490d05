"""What was measured on a bench, what proves its model false, what to measure next; what results rest on."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ...models.bench import TARGETS
from ..calibration import Calibration
from ..calibration.estimates import chebyshev_centre
from ..calibration.model import Linearisation
from ..document.blocks import Download, Section, Table
from ..document.notation import Cell, effect_formula, equation, half_width, minus, signed, typeset
from ..records import PositionRecord
from ..rounding import digits, downwards, exactly, residual, to_bound, upwards
from .makers import cited, matrix_text, versions
from .pictures.records import bench_tour
from .pictures.residuals import next_directions

if TYPE_CHECKING:
    from polars import DataFrame

    from ..calibration.correction import Correction
    from ..diagnosis.cause import Cause

VERDICTS = {
    "consistent": "consistent: the model explains the record within the noise bound",
    "falsified": "falsified: no parameters of the model keep every reading within the noise bound",
    "insufficient": "insufficient: the record cannot determine everything that is asked",
    "explained": "explained: a smallest set of effects makes the model consistent, and no other does",
    "ambiguous": "ambiguous: several sets of effects would make the model consistent",
    "unexplained": "unexplained: the model is falsified and nothing that can be named mends it",
}


def measured_section(record: PositionRecord, result: Calibration) -> Section:
    """The record in words, and where on the sphere it has measured."""
    seconds = float(np.ptp(record.time_s))
    lasted = f"{digits(seconds)} seconds" if seconds < 120.0 else f"{digits(seconds / 60.0)} minutes"
    said = [
        f"{len(record)} positions of the table within {lasted}, three accelerometers at each; "
        f"{result.measurements} readings are used."
    ]
    if record.raw is not None:
        found, taken = len(record.rests), f", of which {len(record)} are used" * (len(record.rests) != len(record))
        said.append(f"They are averages of the rests that were found in a time series: {found}{taken}.")
    known = []
    if record.temperature is not None:
        low, high = float(record.temperature.min()), float(record.temperature.max())
        known.append(
            f"temperature {digits(low)} to {digits(high)} °C" if high - low >= 0.05 else f"temperature {digits(low)} °C"
        )
    if record.approach_alpha is not None:
        known.append("the senses in which the positions were approached")
    if record.mounting is not None:
        known.append(f"the mountings {', '.join(dict.fromkeys(record.mounting))}")
    if known:
        said.append(f"Known besides: {'; '.join(known)}.")
    said.append(
        f"Errors of averaged readings are taken to be within σ = {upwards(result.noise_bound, 3)} g ({basis(result)})."
    )
    said += [f"Warning: {warning}." for warning in result.warnings]
    return Section(
        "What was measured",
        said,
        next_directions(record.alpha, record.beta, np.zeros(0), np.zeros(0)),
        "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
    )


def run_section(table: "DataFrame", gravity: float, files: list[Path]) -> Section:
    """The position programme that a simulated bench carried out."""
    time, alpha, beta = (table[name].to_numpy() for name in ("time_s", "alpha_deg", "beta_deg"))
    readings = np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1) / gravity
    return Section(
        "The bench, simulated",
        "Four FMUs, coupled by the orchestrator: the table carries accelerometers and gyros through positions and "
        f"whole turns for {digits(time[-1])} s, and the attitude computer follows the gyros.",
        bench_tour(time, (alpha, beta), readings),
        "Angles of the two axes and readings of the three accelerometers.",
        files=files,
    )


def basis(result: Calibration) -> str:
    """On what the noise bound rests, in words."""
    return "as given" if result.sigma.kind == "bound" else result.sigma.basis


def key_figures(result: Calibration) -> dict[str, object]:
    """What stands below the verdict."""
    return {
        "positions": result.positions,
        "readings": result.measurements,
        "noise bound σ": f"{upwards(result.noise_bound, 3)} g",
        "least largest residual": f"{residual(result.radius)} σ",
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
        angles = (digits(float(np.degrees(angle[i])), 7) for angle in (here.positions.alpha, here.positions.beta))
        figures = (*angles, digits(float(here.input[i, axis])), digits(float(left[i, axis])))
        rows.append([int(numbers[i]), int(axis) + 1, *figures])
    header = ["position", "accelerometer", "α [deg]", "β [deg]", "its input [g]", "at best off by [σ]"]
    return Section(
        "Evidence: the readings that prove it",
        f"These {len(result.witness)} readings alone, whatever the others are, cannot all be within "
        f"{residual(result.radius)} σ of any parameters' prediction. If one of them is known to be "
        "spoilt, leave its row out and look again.",
        table=Table(header, rows),
    )


OPTIONAL = ("mounting", "hours", "repeats", "approach_alpha", "approach_beta")
MOST_LABELS = 24
"""Up to so many positions are numbered in the picture."""
SENSES = {1: "forwards", -1: "backwards"}


def position_text(position: Mapping[str, Any], bound: float | None = None) -> str:
    """A proposed table position; with σ, a fraction of g, by how many of them candidates differ there at least."""
    text = f"alpha {exactly(position['alpha_deg'])}°, beta {exactly(position['beta_deg'])}°"
    if "repeats" in position:
        text += f", position {position['repeats']} again"
    if "hours" in position:
        text += f", {exactly(position['hours'])} h after the first"
    if "mounting" in position:
        text += f", mounting {position['mounting']}"
    if "approach_alpha" in position:
        text += f", approached {SENSES[position['approach_alpha']]} in alpha, "
        text += f"{SENSES[position['approach_beta']]} in beta"
    if position.get("separates"):
        apart = position.get("apart_g")
        far = "" if apart is None or bound is None else f" by {downwards(max(apart, 0.0) / bound)} σ at least"
        text += f" (separates {', '.join(position['separates'])}{far})"
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
        angles = (exactly(float(p[name])) for name in ("alpha_deg", "beta_deg"))
        how = (_told(name, p[name]) if name in p else None for name in OPTIONAL)
        apart = p.get("apart_g")
        told = None if apart is None else downwards(max(apart, 0.0) / here.bound.min())
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
    header = [
        "no.",
        "α [deg]",
        "β [deg]",
        "mounting",
        "t [h]",
        "again",
        "α turned",
        "β turned",
        "tells apart",
        "by [σ]",
    ]
    file = "next-positions.csv"
    return Section(
        "Where and when to measure next" if any("hours" in p for p in positions) else "Where to measure next",
        said,
        next_directions(here.positions.alpha, here.positions.beta, alpha, beta, labels),
        "The vertical as the inner frame sees it at each position; equal areas are equal solid angles.",
        Table(header, rows).told(),
        download=Download(file, next_positions_csv(positions), f"{file}, to take to the table"),
    )


def _told(name: str, value: Any) -> str:
    """What an optional column says of a proposed position."""
    if name.startswith("approach"):
        return SENSES[value]
    return exactly(float(value)) if name == "hours" else str(value)


def deciding(here: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """The positions at which two candidates surely differ."""
    return [p for p in positions if p.get("apart_g") is not None and p["apart_g"] > 2.0 * here.bound.min()]


def provenance(result: Calibration, more: Mapping[str, object] | None = None) -> dict[str, object]:
    """What a result rests on: record, options, versions; the same inputs give the same page."""
    p = result.linearised.parametrisation
    given: dict[str, object] = {}
    if result.provenance is not None:
        given["record"] = result.provenance.record
        if result.provenance.sha256:
            given["record, SHA-256"] = result.provenance.sha256
    given["noise bound"] = typeset(f"{exactly(result.noise_bound)} g, {basis(result)}")
    given["gravity"] = f"{exactly(result.gravity)} m/s²"
    given["model"] = f"{result.baseline} scale factors, convention {result.convention}"
    if result.provenance is not None:
        u, v = result.provenance.bounds
        given["bounds of (1.7)"] = f"u = {exactly(u)}, v = {exactly(v)}"
    for name, matrix in zip(p.mountings, p.matrices, strict=True):
        given[f"mounting {name}"] = matrix_text(np.asarray(matrix).tolist())
    for prior in result.priors:
        given[f"known beforehand, {prior.expression}"] = f"at most {exactly(prior.limit)}"
    return given | dict(more or {}) | versions()


def calibration_sources(result: Calibration) -> list[str]:
    """Of a calibration."""
    falsified, allan = result.verdict == "falsified", "Allan" in result.sigma.basis
    return cited("guaranteed", "simplex", falsified and "chebyshev", allan and "allan")


# The model of bench and block, with its numbers

Value = tuple[float | None, float | None]
"""A target's value, None where it is open, and the bound of its error, None where there is none."""

OPEN = "?"
"""In place of a number that the readings do not determine."""

SCALE = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))
CROSS: tuple[tuple[str, ...], ...] = ((), ("X6+X8",), ("X7+X12", "X11+X13"))
BIAS = ("X16", "X17", "X18")


PHYSICAL_WORDS = (
    (r"gyro-bias-(\d)", r"bias of gyro \1"),
    (r"gyro-scale-factor-error-(\d)", r"scale-factor error of gyro \1"),
    (r"gyro-misalignment-(\d)(\d)", r"misalignment of gyro \1 towards axis \2"),
    (r"gyro-g-sensitivity-(\d)(\d)", r"sensitivity of gyro \1 to specific force along axis \2"),
    ("gyro-lag-behind-accelerometers", "lag of the gyros behind the accelerometers"),
    ("accelerometer-lag", "lag of the accelerometers behind the encoders"),
    (r"gyro-lag", "lag of the gyros behind the encoders"),
    (r"scale-factor-error-plus-(\d)", r"scale-factor error of accelerometer \1 for positive input"),
    (r"scale-factor-error-minus-(\d)", r"scale-factor error of accelerometer \1 for negative input"),
    (r"scale-factor-asymmetry-(\d)", r"scale-factor asymmetry of accelerometer \1"),
    (r"misalignment-(\d)(\d)", r"misalignment of accelerometer \1 towards axis \2"),
    (r"mounting-error-(\d)", r"mounting error about axis \1"),
    (r"bias-(\d)", r"bias of accelerometer \1"),
    (r"outer-axis-tilt", "tilt of the outer axis"),
    (r"outer-angle-offset", "zero of the outer angle"),
    (r"axis-nonorthogonality", "non-orthogonality of the axes"),
)
"""A target's name, and what an engineer calls it."""


def physical_words(name: str) -> str:
    """A target's name in words: "bias-1" is "bias of accelerometer 1"; the name of a mounting stays behind it."""
    for pattern, words in PHYSICAL_WORDS:
        name = re.sub(pattern, words, name)
    return name


MOST_NAMED = 5
"""So many targets that are open are named in a sentence."""


def open_targets(result: Calibration) -> str:
    """What the measurements leave open, in a sentence."""
    gaps = result.missing
    if not gaps:
        return "whether an error that holds over a rest is in them" if result.radius > 1.0 else "more than they have"
    if len(gaps) == len(result.targets):
        return "any of the targets"
    if len(gaps) > MOST_NAMED:
        return f"{len(gaps)} of the {len(result.targets)} targets"
    return ", ".join(physical_words(gap.name) for gap in gaps)


def missing_lines(result: Calibration) -> list[str]:
    """What the measurements leave open, in words."""
    if not result.missing:
        return []
    if len(result.missing) == len(result.targets):
        return ["The readings determine no target. Measure the positions named, or say what is known by --prior."]
    named = ", ".join(f"{physical_words(gap.name)} ({gap.symbol})" for gap in result.missing)
    return [f"The readings do not determine: {named}. Measure the positions named, or say what is known by --prior."]


def bench_section(result: Calibration, values: Mapping[str, Value], causes: "Sequence[Cause]" = ()) -> Section:
    """The model of bench and block with the values of the targets of case (A1); an extended one with its effects."""
    scales = "of either sign" if result.baseline == "asymmetric" else "the same for both signs"
    said = [
        "The bench: a block of three accelerometers with biases, misalignments and scale factors "
        f"{scales}, mounted on a table whose axes are not quite horizontal and perpendicular. n is what the "
        "accelerometers feel, in units of g; angles are in radians. Numbers are rounded to what the bounds of their "
        "errors justify.",
    ]
    if any(value is None for value, _ in values.values()):
        said.append("A question mark stands for what the readings do not determine.")
    if len(result.linearised.parametrisation.mountings) > 1:
        said.append(f"Table and mounting as in {result.linearised.parametrisation.mountings[0]}.")
    turn = ", ".join(number(values[symbol]) for symbol in ("X13", "-X12", "X8"))
    table = [
        "n = exp(ϑ) Q up(α − Δα, β; κ, ε)",
        f"κ = {number(values['X1'])}, Δα = {number(values['X2'])}, ε = {number(values['X3'])}",
        f"ϑ = ({turn})",
    ]
    return section_of_model(said, [*_block(values), *table], causes)


def calibrated_values(result: Calibration) -> dict[str, Value]:
    """The targets of case (A1): estimates where there are such, else the fit."""
    here = result.linearised
    at_fit = dict(zip(TARGETS, (here.parametrisation.selection[0] @ here.point).tolist(), strict=True))
    found = {e.symbol: (e.central, half_width(e.low, e.high)) for e in result.targets if e.central is not None}
    values: dict[str, Value] = {symbol: (value, None) for symbol, value in at_fit.items()}
    return values | found | {gap.symbol: (None, None) for gap in result.missing}


def _block(values: Mapping[str, Value]) -> list[str]:
    """The three accelerometers."""
    lines = []
    for p in range(3):
        n = f"n_{p + 1}"
        plus, minus = (number(values[symbol]) for symbol in SCALE[p])
        choice = f"{{{plus} {n} ; 'where' {n} > 0 | {minus} {n} ; 'where' {n} < 0}}"
        terms = [f"f_{p + 1}/g = {n} +", f"({plus}) {n}" if plus == minus != OPEN else choice]
        for symbol, of in (*((s, f"n_{k + 1}") for k, s in enumerate(CROSS[p])), (BIAS[p], "")):
            text = number(values[symbol])
            terms.append(f"{'−' if text.startswith('−') else '+'} {text.lstrip('−')} {of}")
        lines.append(" ".join(terms))
    return lines


def section_of_model(said: Sequence[str], lines: Sequence[str], causes: "Sequence[Cause]") -> Section:
    more = ["The last lines are the effects by which the simulation was extended."] if causes else []
    return Section("What was simulated", [*said, *more], equations=[*map(equation, lines), *cause_lines(causes)])


def cause_lines(causes: "Sequence[Cause]") -> list[str]:
    """What each effect adds, as MathML; none for an effect without a formula."""
    lines = []
    for cause in causes:
        texts = {
            parameter.name: number((value, 0.5 * (high - low)))
            for parameter, value, (low, high) in zip(cause.parameters, cause.values, cause.intervals, strict=True)
        }
        formula = effect_formula(cause.place, texts)
        if formula is not None:
            lines.append(equation(formula))
    return lines


def correction_terms(
    correction: "Correction", bound: float | None = None, below: str = ""
) -> list[tuple[str, str, str, str]]:
    """For each accelerometer its input, the reading less what is known of it, and the scales of either sign.

    Numbers have the digits that a bound [g] justifies, twelve where none is given.
    """

    def text(value: float) -> str:
        return minus(digits(value, 12) if bound is None else to_bound(value, bound))

    found = []
    for p in range(3):
        terms = [f"f{below}{p + 1}/g", signed(-correction.bias[p], text(abs(correction.bias[p])))]
        for c, g in enumerate(correction.gamma[p, :p].tolist(), start=1):
            terms.append(signed(-g, f"{text(abs(g))} n{below}{c}"))
        scales = (text(scale[p]) for scale in (correction.plus, correction.minus))
        found.append((f"n{below}{p + 1}", f"({' '.join(terms)})", *scales))
    return found


def number(value: Value) -> str:
    """A number as its bound justifies it, or the sign for one that is open."""
    return minus(to_bound(*value)) or OPEN
