"""Parts of pages on a bench: the record, the readings that falsify a model, the next positions, the provenance."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .. import reports
from ..calibrated import Calibration
from ..calibration.estimates import chebyshev_centre
from ..calibration.model import Linearisation
from ..document.blocks import Download, Section, Table
from ..document.notation import Cell, effect_formula, equation, listed, minus, signed, typographic, unit_text
from ..records import PositionRecord
from ..rounding import Number, digits, downwards, exactly, interval, residual, to_bound, upwards
from .sources import cited, matrix_text, versions

if TYPE_CHECKING:
    from polars import DataFrame

    from ..calibration.correction import Correction
    from ..diagnosis.cause import Cause


MOST_READINGS = 6
"""Largest number of readings in a line that prove a falsification."""


def measured_section(record: PositionRecord, result: Calibration) -> Section:
    """Return the record in words, and its positions on the sphere."""
    seconds = float(np.ptp(record.time_s))
    duration = f"{digits(seconds)} seconds" if seconds < 120.0 else f"{digits(seconds / 60.0)} minutes"
    paragraphs = [
        f"{len(record)} positions of the table within {duration}, three accelerometers at each; "
        f"{result.measurements} readings are used."
    ]
    if record.raw is not None:
        rests = str(len(record.rests))
        if len(record.rests) != len(record):
            rests += f", of which {len(record)} are used"
        paragraphs.append(f"Each is the average of a rest in a time series: {rests}.")
    columns = []
    if record.temperature is not None:
        columns.append(f"temperature {temperature_text(record.temperature)} °C")
    if record.approach_alpha is not None:
        columns.append("the senses in which the positions were approached")
    if record.mounting is not None:
        columns.append(f"the mountings {', '.join(dict.fromkeys(record.mounting))}")
    if columns:
        paragraphs.append(f"The record also has {'; '.join(columns)}.")
    paragraphs.append(
        f"Errors of averaged readings are taken to be within σ = {upwards(result.noise_bound, 3)} g ({basis(result)})."
    )
    return Section(
        "Measurements",
        paragraphs,
        reports.next_directions(record.alpha, record.beta, np.zeros(0), np.zeros(0)),
        "Direction of the vertical in the inner frame at each measured position.",
    )


def temperature_text(temperature: NDArray) -> str:
    """Return the least and the largest temperature [°C], or the only one."""
    low, high = float(temperature.min()), float(temperature.max())
    return f"{digits(low)} to {digits(high)}" if high - low >= 0.05 else digits(low)


def run_section(table: "DataFrame", gravity: float, files: list[Path]) -> Section:
    """Return the position programme of a simulated bench."""
    time, alpha, beta = table["time_s"].to_numpy(), table["alpha_deg"].to_numpy(), table["beta_deg"].to_numpy()
    readings = np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1) / gravity
    return Section(
        "The bench, simulated",
        "Four FMUs, coupled by the orchestrator: the table carries accelerometers and gyros through positions and "
        f"whole turns for {digits(time[-1])} s, and the attitude computer follows the gyros.",
        reports.bench_tour(time, (alpha, beta), readings),
        "Angles of the two axes and readings of the three accelerometers.",
        files=files,
    )


def basis(result: Calibration) -> str:
    """Return the basis of the noise bound."""
    return "as given" if result.sigma.kind == "bound" else result.sigma.basis


def key_figures(result: Calibration) -> dict[str, object]:
    """Return the figures below the verdict."""
    figures: dict[str, object] = {}
    if result.positions is not None:
        figures |= {"positions": result.positions, "readings": result.measurements}
    if result.sigma.value is None:
        figures["bounds from"] = result.sigma.basis
    else:
        figures["noise bound σ"] = f"{upwards(result.noise_bound, 3)} g ({basis(result)})"
    over = "σ" if result.gyros is None else "times its bound"
    figures["least largest residual"] = f"{residual(result.radius)} {over}"
    return figures


def proved(result: Calibration, numbers: NDArray) -> NDArray:
    """Return a mask of the readings (N, 3) that prove a falsification, by the record's numbers (N,) of its
    positions."""
    proof = np.zeros((len(numbers), 3), dtype=bool)
    for reading in result.witness:
        proof[numbers == reading.position, reading.accelerometer - 1] = True
    return proof


def centre_residual(result: Calibration) -> NDArray:
    """Return the residuals (N, 3) [g] for the least largest residual in units of its bound."""
    centre = chebyshev_centre(result.linearised)[1]
    return readings_at(result.linearised, centre)


def readings_at(linearised: Linearisation, point: NDArray) -> NDArray:
    """Return the residuals (N, 3) [g] of readings at a point, without the rows of prior knowledge."""
    return linearised.residual_at(point)[: linearised.reading.size].reshape(-1, 3)


def bounds_of_readings(linearised: Linearisation) -> NDArray:
    """Return the bounds (N, 3) [g] of readings."""
    return linearised.bound[: linearised.reading.size].reshape(-1, 3)


def proof_section(result: Calibration, numbers: NDArray) -> Section | None:
    """Return the readings that prove that no parameters fit; None if there are none."""
    if not result.witness:
        return None
    linearised = result.linearised
    in_bounds = centre_residual(result) / bounds_of_readings(linearised)
    alpha, beta = np.degrees(linearised.positions.alpha), np.degrees(linearised.positions.beta)
    rows = []
    for i, axis in np.argwhere(proved(result, numbers)).tolist():
        row: list[Cell] = [int(numbers[i]), axis + 1]
        row += [digits(float(alpha[i]), 7), digits(float(beta[i]), 7)]
        row += [digits(float(linearised.input[i, axis])), digits(float(in_bounds[i, axis]))]
        rows.append(row)
    header = ["position", "accelerometer", "α [deg]", "β [deg]", "its input [g]", "at best off by [σ]"]
    return Section(
        "Evidence: the readings that prove it",
        f"These {len(result.witness)} readings alone, whatever the others are, cannot all be within "
        f"{residual(result.radius)} σ of any parameters' prediction. If one of them is known to be "
        "spoilt, leave its row out and look again.",
        table=Table(header, rows),
    )


WOULD_DETERMINE = (
    "Readings at these positions, with those of the record, determine the open targets. Or state a prior by --prior."
)
NO_RESIDUAL = 1e-6
"""Least largest residual, over its bound, below which parameters fit any readings."""
OPTIONAL = ("mounting", "hours", "repeats", "approach_alpha", "approach_beta")
MOST_LABELS = 24
"""Largest number of positions that have numbers in the picture."""
SENSES = {1: "forwards", -1: "backwards"}


def next_positions_csv(positions: Sequence[Mapping[str, Any]]) -> str:
    """Return positions as CSV: number, both angles [deg], and mounting and senses of the approach if they matter."""
    present = set()
    for position in positions:
        present |= position.keys()
    names = ["alpha_deg", "beta_deg"]
    names += [name for name in OPTIONAL if name in present]
    lines = [f"position,{','.join(names)}"]
    for number, position in enumerate(positions, start=1):
        cells = [str(position.get(name, "")) for name in names]
        lines.append(f"{number},{','.join(cells)}")
    return "\n".join(lines) + "\n"


def next_sections(
    linearised: Linearisation,
    positions: Sequence[Mapping[str, Any]],
    purpose: str = WOULD_DETERMINE,
) -> list[Section]:
    """Return the proposed positions on the sphere, as a table and as a file; empty if there are none."""
    if not positions:
        return []
    alpha = np.radians([position["alpha_deg"] for position in positions])
    beta = np.radians([position["beta_deg"] for position in positions])
    rows = []
    separates = False
    for number, position in enumerate(positions, start=1):
        cells: list[Cell] = [number, exactly(position["alpha_deg"]), exactly(position["beta_deg"])]
        for name in OPTIONAL:
            cells.append(_optional_text(name, position[name]) if name in position else None)
        apart = position.get("apart_g")
        cells.append(", ".join(position.get("separates", ())) or None)
        cells.append(None if apart is None else downwards(max(apart, 0.0) / linearised.bound.min()))
        rows.append(cells)
        separates = separates or bool(position.get("separates"))
    if separates:
        sure = len(deciding(linearised, positions))
        purpose = (
            "Predictions of the two candidates that a position is for differ there, or at another of the positions for "
            "the same two, by at least the last column, whatever their parameters. More than 2 σ decides between them "
            f"in any noise: {sure or 'none'} of {len(positions)} positions do."
        )
    labels = [""]
    if len(positions) <= MOST_LABELS:
        labels = [str(number) for number in range(1, len(positions) + 1)]
    angles = ["no.", "α [deg]", "β [deg]"]
    header = [*angles, "mounting", "t [h]", "again", "α turned", "β turned", "tells apart", "by [σ]"]
    in_time = any("hours" in position for position in positions)
    file = "next-positions.csv"
    return [
        Section(
            "Where and when to measure next" if in_time else "Where to measure next",
            [purpose],
            reports.next_directions(linearised.positions.alpha, linearised.positions.beta, alpha, beta, labels),
            "Direction of the vertical in the inner frame at each position (equal-area map).",
            Table(header, rows),
            download=Download(file, next_positions_csv(positions), f"{file}, to take to the table"),
        )
    ]


def _optional_text(name: str, value: Any) -> str:
    """Return an optional column's text for a proposed position."""
    if name.startswith("approach"):
        return SENSES[value]
    return exactly(float(value)) if name == "hours" else str(value)


def deciding(linearised: Linearisation, positions: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Return the positions at which two candidates surely differ."""
    return [p for p in positions if p.get("apart_g") is not None and p["apart_g"] > 2.0 * linearised.bound.min()]


def provenance(result: Calibration, seeds: Mapping[str, object] | None = None) -> dict[str, object]:
    """Return the provenance of a result: record, options, versions; the same inputs give the same page."""
    facts: dict[str, object] = {}
    source = result.provenance
    if source is not None:
        facts["record"] = source.record
        if source.sha256:
            facts["record, SHA-256"] = source.sha256
    facts["noise bound"] = typographic(f"{exactly(result.noise_bound)} g, {basis(result)}")
    if result.convention is not None:
        facts["gravity"] = f"{exactly(result.gravity)} m/s²"
        facts["model"] = f"{result.baseline} scale factors, convention {result.convention}"
    if source is not None and source.bounds:
        u, v = source.bounds
        facts["bounds of (1.7)"] = f"u = {exactly(u)}, v = {exactly(v)}"
    for name, matrix in result.mountings.items():
        facts[f"mounting {name}"] = matrix_text(matrix)
    for prior in result.priors:
        facts[f"known beforehand, {prior.expression}"] = f"at most {exactly(prior.limit)}"
    return facts | dict(seeds or {}) | versions()


def calibration_sources(result: Calibration) -> list[str]:
    """Return the publications of the methods of a calibration."""
    falsified = result.verdict == "falsified"
    return cited("guaranteed", "simplex", falsified and "chebyshev", "Allan" in result.sigma.basis and "allan")


PHYSICAL_WORDS = (
    (r"gyro-bias-(\d)", r"bias of gyro \1"),
    (r"gyro-scale-factor-error-(\d)", r"scale-factor error of gyro \1"),
    (r"gyro-misalignment-(\d)(\d)", r"misalignment of gyro \1 towards axis \2"),
    (r"gyro-g-sensitivity-(\d)(\d)", r"sensitivity of gyro \1 to specific force along axis \2"),
    ("gyro-lag-behind-accelerometers", "lag of the gyros behind the accelerometers"),
    (r"accelerometer-place-(\d)(\d)", r"place of accelerometer \1 along axis \2"),
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
"""A target's name, and its technical term."""


def physical_words(name: str) -> str:
    """Return a target's name in words: "bias-1" is "bias of accelerometer 1", followed by the name of a mounting."""
    for pattern, words in PHYSICAL_WORDS:
        name = re.sub(pattern, words, name)
    return name


MOST_NAMED = 5
"""Largest number of undetermined targets that a sentence names."""


def open_targets(result: Calibration) -> str:
    """Return the undetermined targets, for a sentence."""
    gaps = result.missing
    if not gaps:
        falsified = result.radius is not None and result.radius > 1.0
        return "whether an error that holds over a rest is in them" if falsified else "more than they have"
    if len(gaps) == len(result.targets):
        return "any of the targets"
    if len(gaps) > MOST_NAMED:
        return f"{len(gaps)} of the {len(result.targets)} targets"
    return ", ".join(physical_words(gap.name) for gap in gaps)


def measure_words(positions: Sequence[Mapping[str, Any]]) -> str:
    """Return the number of proposed positions in a sentence behind another; empty without any."""
    count = len(positions)
    return f" Measure {count} more position{'s' * (count > 1)}." if count else ""


def missing_texts(result: Calibration) -> list[str]:
    """Return sentences on the undetermined targets; empty if there are none."""
    if not result.missing:
        return []
    if len(result.missing) == len(result.targets):
        return []
    names = [f"{physical_words(gap.name)} ({gap.symbol})" for gap in result.missing]
    return [f"The readings do not determine: {', '.join(names)}."]


def sizes_of(cause: "Cause") -> Iterator[tuple[str, Number, Number, Number, str | None]]:
    """Return for each parameter of a cause its name, its estimate with its interval, rounded, and its unit."""
    for parameter, value, ends in zip(cause.parameters, cause.values, cause.intervals, strict=True):
        yield parameter.name, *interval(value, *ends), unit_text(parameter.unit)


def cause_lines(causes: "Sequence[Cause]") -> list[str]:
    """Return the formula of each effect as MathML; empty for an effect without a formula."""
    lines = []
    for cause in causes:
        texts = {}
        for parameter, value, (low, high) in zip(cause.parameters, cause.values, cause.intervals, strict=True):
            texts[parameter.name] = minus(to_bound(value, 0.5 * (high - low)))
        formula = effect_formula(cause.place, texts)
        if formula is not None:
            lines.append(equation(formula))
    return lines


def correction_terms(
    correction: "Correction", bound: float | None = None, below: str = ""
) -> list[tuple[str, str, str, str]]:
    """Return for each accelerometer its input, the reading less its known errors, and the scales of either sign.

    Numbers have the digits that a bound [g] justifies, twelve without a bound.
    """

    def text(value: float) -> str:
        return minus(digits(value, 12) if bound is None else to_bound(value, bound))

    equations = []
    for p in range(3):
        terms = [f"f{below}{p + 1}/g", signed(-correction.bias[p], text(abs(correction.bias[p])))]
        for column, gamma in enumerate(correction.gamma[p, :p].tolist(), start=1):
            terms.append(signed(-gamma, f"{text(abs(gamma))} n{below}{column}"))
        reading = f"({' '.join(terms)})"
        equations.append((f"n{below}{p + 1}", reading, text(correction.plus[p]), text(correction.minus[p])))
    return equations


def proof_lines(calibration: Calibration) -> list[str]:
    """Return the readings that prove that no parameters fit; empty if there are none."""
    if not calibration.witness:
        return []
    readings = [f"f{reading.accelerometer} at {reading.position}" for reading in calibration.witness]
    return [f"Readings that prove it, by accelerometer and position: {listed(readings, MOST_READINGS)}."]
