"""The page of a calibration without a table."""

import math
from collections.abc import Sequence

from ..calibrated import ByHand, Calibration, Parameter
from ..document.blocks import Page, Section, Table, Tone, table_of
from ..document.notation import Cell, unit_text
from ..rounding import digits, exactly, residual, upwards
from . import bench

TONES: dict[str, Tone] = {"usable": "good", "consistent": "good"}
MOST_CLOSED = 6
"""Largest number of poses and turns that are listed."""


def by_hand_page(result: Calibration, _: object = None) -> Page:
    """Return the page of a calibration without a table: how well it predicts, what is open, parameters."""
    assert result.by_hand is not None
    sections = [Section("How well it predicts", prediction_lines(result, result.by_hand))]
    if result.open:
        sections.append(Section("What is open", open_lines(result)))
    sections.append(parameter_section(result))
    sections += record_sections(result)
    record = "" if result.provenance is None else f" by {result.provenance.record}"
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
        return (
            f"Not one instrument: together the records leave {digits(basis.pooled.growth, 2)} times as much as each "
            f"alone (F = {digits(basis.pooled.f, 3)}). Each is calibrated by itself."
        )
    if result.verdict == "falsified":
        return (
            f"Falsified: no parameters keep every reading within σ = {exactly(result.noise_bound)} g; with "
            f"{result.option_to_stand} they would. The estimates hold with that σ."
        )
    if result.verdict == "insufficient":
        if basis.pose_error.worst > 0.01:
            return (
                f"Insufficient: |f| in an unseen pose may be wrong by {worst} (1 sd). The estimates serve near the "
                "poses that were seen."
            )
        return "Insufficient: the accelerometers are calibrated, and the moves leave the gyros open."
    if result.verdict == "consistent":
        return (
            f"Consistent: some parameters keep every reading within σ, the best within {residual(result.radius)} σ; "
            f"|f| in an unseen pose is known to {worst} (1 sd)."
        )
    return f"Usable: |f| in an unseen pose is known to {worst} (1 sd): {basis.pose_error.words}."


def prediction_lines(result: Calibration, basis: ByHand) -> list[str]:
    """Return rests and moves, what they leave, and the gain at those that were left out, in lines."""
    with_truth = any(p.symbol == "L" for p in result.parameters)
    pieces = "windows with a true attitude" if with_truth else "moves"
    counts = [f"{basis.rests} rests"]
    if basis.turn_error is not None:
        counts.append(f"{basis.moves} {pieces}")
    if basis.turns:
        counts.append(f"{basis.turns} known turns")
    left = f"the norms of gravity differ by {digits(1e3 * basis.residual_norm, 2)} mg rms"
    if basis.residual_move is not None:
        left += f", the {pieces} by {_arcmin(basis.residual_move)} arcmin"
    lines = [f"{', '.join(counts)}; calibrated {left}"]
    if basis.pooled is not None:
        f = digits(basis.pooled.f, 2)
        lines.append(f"pooled, the records leave {digits(basis.pooled.growth, 2)} times as much as alone (F = {f})")
    sigma = result.sigma
    if sigma.value is not None:
        lines.append(f"σ = {upwards(sigma.value, 2)} g ({sigma.basis})")
    gain = basis.gain
    if gain is not None and gain.rest_before is not None and gain.rest_after is not None:
        text = f"{digits(1e3 * gain.rest_before, 3)} mg as read, {digits(1e3 * gain.rest_after, 2)} mg calibrated"
        lines.append(f"rests that were not used (five parts in turn): {text}, rms")
    if gain is not None and gain.move_before is not None and gain.move_after is not None:
        text = f"{_arcmin(gain.move_before)} arcmin as read, {_arcmin(gain.move_after)} arcmin calibrated"
        lines.append(f"{pieces} that were not used: {text}, rms")
    if basis.largest_move is not None and with_truth:
        bound = digits(math.degrees(basis.largest_move) * 60.0, 3)
        lines.append(
            f"the gyros stand with a bound of {bound} arcmin of a window's error; below it they do not explain all"
        )
    if basis.axes == "true attitude":
        lines.append("M is in the axes of the true attitude: the rests do not tie the accelerometers to them")
    if basis.turn_error is not None:
        error = _arcmin(basis.turn_error.worst)
        lines.append(f"a turn of 90° about the worst axis is known to {error} arcmin (1 sd)")
    if basis.sensitivity is not None and basis.sensitivity.taken:
        lines.append(
            f"the gyros depend on gravity (F = {digits(basis.sensitivity.f, 3)}): nine sensitivities are fitted"
        )
    if basis.case is not None:
        error = digits(math.degrees(basis.case.standard_error), 2)
        where = "the true attitude" if with_truth else "the case, by its faces,"
        lines.append(f"the axes of {where} are known to {error}° (1 sd)")
    return lines


def record_sections(result: Calibration) -> list[Section]:
    """Return what each of several records has of its own."""
    sections = []
    for label, record in result.of_record.items():
        assert record.by_hand is not None
        basis = record.by_hand
        worst = digits(1e3 * basis.pose_error.worst, 2)
        text = f"{basis.rests} rests; |f| in an unseen pose is known to {worst} mg (1 sd)"
        sections.append(Section(label, [text], table=parameter_table(record.parameters)))
    return sections


def _arcmin(angle: float) -> str:
    return digits(math.degrees(angle) * 60.0, 2)


def open_lines(result: Calibration) -> list[str]:
    """Return the poses and turns that would close what is open, in lines."""
    lines = []
    for entry in result.open[:MOST_CLOSED]:
        lines.append(f"add {entry.close_by} (open: {', '.join(entry.parameters)})")
    if len(result.open) > MOST_CLOSED:
        lines.append(f"and {len(result.open) - MOST_CLOSED} more in the JSON")
    return lines


def parameter_section(result: Calibration) -> Section:
    """Return the parameters with their errors."""
    gravity = exactly(result.gravity)
    equations = [f"reading/g = (I + Γ) n + b with n = f/g, g = {gravity} m/s²; accelerometer 1 is axis 1."]
    if result.by_hand is not None and result.by_hand.turn_error is not None:
        equations.append("Gyros: reading = (I + M) ω + S n + B in the same axes.")
    if any(not p.determined for p in result.parameters):
        equations.append(
            "Where the prior decides, the record tells next to nothing: 5 %, 30 mrad, 100 mg; gyros 3 %, 10 mrad."
        )
    title = "What the records share" if result.of_record else "Parameters"
    return Section(title, equations, table=parameter_table(result.parameters))


def parameter_table(parameters: Sequence[Parameter]) -> Table:
    """Return a row for each parameter: symbol, words, estimate, standard error, interval, basis."""
    columns = ["symbol", "name", "estimate", "standard_error", "low", "high", "unit"]
    table = table_of(parameters, columns, {"unit": unit_text})
    rows: list[list[Cell]] = []
    for cells, parameter in zip(table.rows, parameters, strict=True):
        rows.append([*cells, None if parameter.determined else "the prior decides"])
    return Table([*table.header, "note"], rows)
