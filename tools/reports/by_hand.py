"""The page of a calibration without a table."""

import math
from collections.abc import Sequence

import numpy as np

from ..calibrated import ByHand, Calibration, Parameter
from ..document.blocks import Page, Section, Table, Tone, table_of
from ..document.notation import unit_text
from ..motion.determinacy import USABLE_TURN
from ..rounding import digits, exactly, residual, upwards
from . import bench

TONES: dict[str, Tone] = {"usable": "good", "consistent": "good"}
MOST_CLOSED = 6
"""Largest number of poses and turns that are listed."""


def by_hand_page(result: Calibration, _: object = None) -> Page:
    """Return the page of a calibration without a table: predicted errors, open parameters, parameters."""
    assert result.by_hand is not None
    sections = [Section("Accuracy", prediction_lines(result, result.by_hand))]
    if result.open:
        sections.append(Section("Open parameters", open_lines(result)))
    sections.append(parameter_section(result))
    sections += record_sections(result)
    record = "" if result.provenance is None else f" of {result.provenance.record}"
    return Page(
        f"Calibration{record}",
        verdict_sentence(result),
        sections,
        tone=TONES.get(result.verdict, "attention"),
        provenance=bench.provenance(result),
        warnings=result.warnings,
    )


def verdict_sentence(result: Calibration) -> str:
    """Return the verdict in a sentence with its figures."""
    basis = result.by_hand
    assert basis is not None
    worst = f"{digits(1e3 * basis.pose_error.worst, 2)} mg"
    if basis.pooled is not None and not basis.pooled.one_instrument:
        if result.sigma.kind == "bound":
            return (
                f"Not one instrument: no shared parameters keep every reading within σ = {exactly(result.noise_bound)} "
                f"g; {result.option_to_stand} would. Each record is calibrated separately."
            )
        return (
            f"Not one instrument: residuals of the pooled records are {digits(basis.pooled.growth, 2)} times those of "
            f"each record (F = {digits(basis.pooled.f, 3)}). Each record is calibrated separately."
        )
    if result.verdict == "falsified":
        return (
            f"Falsified: no parameters keep every reading within σ = {exactly(result.noise_bound)} g. The estimates "
            f"hold with {result.option_to_stand}."
        )
    if result.verdict == "insufficient":
        if basis.pose_error.worst > 0.01:
            return (
                f"Insufficient: |f| in an unmeasured pose may be wrong by {worst} (1 sd). Use the estimates near the "
                "measured poses only."
            )
        if basis.turn_error is None or basis.turn_error.worst <= USABLE_TURN:
            return (
                "Insufficient: no rest is beside the parameters, so nothing tests the stated errors. Add a few "
                "rests in further poses."
            )
        return "Insufficient: the accelerometers are calibrated, but the moves do not determine the gyros."
    if result.verdict == "consistent":
        said = f"Consistent: the model explains every reading within {residual(result.radius)} σ"
        if result.radius is not None and result.radius > 1.0 + 1e-6:
            said = f"Not falsified: the best values leave {residual(result.radius)} σ, and nothing excludes better ones"
        return f"{said}; |f| in an unmeasured pose is known to {worst} (1 sd)."
    return f"Usable: |f| in an unmeasured pose is known to {worst} (1 sd)."


def prediction_lines(result: Calibration, basis: ByHand) -> list[str]:
    """Return lines on rests and moves, their residuals, and the gain on left-out ones."""
    records = [record.parameters for record in result.of_record.values()] or [result.parameters]
    truths = [any(p.symbol == "L" for p in parameters) for parameters in records]
    with_truth = all(truths)
    pieces = "moves"
    if any(truths):
        pieces = "windows with a true attitude" if with_truth else "moves and windows with a true attitude"
    counts = [f"{basis.rests} rests"]
    if basis.turn_error is not None:
        counts.append(f"{basis.moves} {pieces}")
    if basis.turns:
        counts.append(f"{basis.turns} known turns (right to 2°, alike to 4°, but for a warning)")
    left = f"|f| at rest differs from g by {digits(1e3 * basis.residual_norm, 2)} mg rms"
    if basis.residual_move is not None:
        left += f", attitude over the {pieces} by {_arcmin(basis.residual_move)} arcmin"
    lines = [f"{', '.join(counts)}. After calibration {left}."]
    if basis.pooled is not None and basis.pooled.f > 0.0:
        f = digits(basis.pooled.f, 2)
        lines.append(
            f"The pooled records leave {digits(basis.pooled.growth, 2)} times the residuals of each one (F = {f})."
        )
    sigma = result.sigma
    if sigma.value is not None:
        lines.append(f"σ = {upwards(sigma.value, 2)} g ({sigma.basis}).")
    gain = basis.gain
    if gain is not None and gain.rest_before is not None and gain.rest_after is not None:
        text = f"{digits(1e3 * gain.rest_before, 3)} mg before, {digits(1e3 * gain.rest_after, 2)} mg after calibration"
        lines.append(f"Rests left out of the fit, a fifth at a time: {text} (rms).")
    if gain is not None and gain.move_before is not None and gain.move_after is not None:
        text = f"{_arcmin(gain.move_before)} arcmin before, {_arcmin(gain.move_after)} arcmin after calibration"
        lines.append(f"{pieces.capitalize()} left out of the fit: {text} (rms).")
    if basis.largest_move is not None and with_truth:
        bound = digits(math.degrees(basis.largest_move) * 60.0, 3)
        lines.append(f"The gyro model fits every window if a window may err by {bound} arcmin.")
    if basis.axes == "true attitude":
        of_first = " of the first record with gyros" if result.of_record else ""
        lines.append(
            f"M is in the axes of the true attitude{of_first}; the rests do not show the accelerometers' axes."
        )
    if basis.turn_error is not None:
        error = _arcmin(basis.turn_error.worst)
        lines.append(f"A turn of 90° about the worst axis is known to {error} arcmin in each component (1 sd).")
    if basis.sensitivity is not None and basis.sensitivity.taken:
        lines.append(
            f"The gyros depend on specific force (F = {digits(basis.sensitivity.f, 3)}): nine sensitivities are fitted."
        )
    if basis.case is not None:
        error = digits(math.degrees(basis.case.standard_error), 2)
        where = "the true attitude" if with_truth else "the case, by its faces,"
        angle = _turn_of(basis.case.rotation)
        lines.append(f"The axes of {where} are turned by {angle}° against the accelerometers' (to {error}°, 1 sd).")
    return lines


def record_sections(result: Calibration) -> list[Section]:
    """Return the parameters and figures of each of several records."""
    sections = []
    for label, record in result.of_record.items():
        assert record.by_hand is not None
        basis = record.by_hand
        worst = digits(1e3 * basis.pose_error.worst, 2)
        lines = [f"{basis.rests} rests. |f| in an unmeasured pose is known to {worst} mg (1 sd)."]
        turned = any(p.symbol == "L" for p in record.parameters) and basis.case
        if turned:
            angle, error = _turn_of(turned.rotation), digits(math.degrees(turned.standard_error), 2)
            lines.append(
                f"The axes of its true attitude are turned by {angle}° against those of M (to {error}°, 1 sd)."
            )
        sections.append(Section(label, lines, table=parameter_table(record.parameters)))
    return sections


def _turn_of(rotation: Sequence[Sequence[float]]) -> str:
    """Return the angle of a rotation matrix in degrees."""
    matrix = np.array(rotation)
    skew = matrix - matrix.T
    sine = 0.5 * math.hypot(skew[2, 1], skew[0, 2], skew[1, 0])
    return digits(math.degrees(math.atan2(sine, 0.5 * (np.trace(matrix) - 1.0))), 2)


def _arcmin(angle: float) -> str:
    return digits(math.degrees(angle) * 60.0, 2)


def open_lines(result: Calibration) -> list[str]:
    """Return lines with the poses and turns that would determine the open parameters."""
    lines = []
    for entry in result.open[:MOST_CLOSED]:
        lines.append(f"Add {entry.close_by} (open: {', '.join(entry.parameters)}).")
    if len(result.open) > MOST_CLOSED:
        lines.append(f"The JSON has {len(result.open) - MOST_CLOSED} more.")
    return lines


def parameter_section(result: Calibration) -> Section:
    """Return the parameters with their errors."""
    gravity = exactly(result.gravity)
    equations = [f"reading/g = (I + Γ) n + b with n = f/g, g = {gravity} m/s²; accelerometer 1 is axis 1."]
    if result.by_hand is not None and result.by_hand.turn_error is not None:
        equations.append("Gyros: reading = (I + M) ω + S n + B in the same axes.")
    if any(not p.determined for p in result.parameters):
        equations.append("Where a note says so, the value is the prior's: 5 %, 30 mrad, 100 mg; gyros 3 %, 10 mrad.")
    title = "Shared parameters" if result.of_record else "Parameters"
    return Section(title, equations, table=parameter_table(result.parameters))


def parameter_table(parameters: Sequence[Parameter]) -> Table:
    """Return a row for each parameter: symbol, words, estimate, standard error, interval, basis."""
    columns = ["symbol", "name", "estimate", "standard_error", "low", "high", "unit"]
    table = table_of(parameters, columns, {"unit": unit_text})
    rows = []
    for cells, parameter in zip(table.rows, parameters, strict=True):
        rows.append([*cells, None if parameter.determined else "from the prior"])
    return Table([*table.header, "note"], rows)
