"""Targets of a calibration: estimates, guaranteed errors, and intervals drawn."""

from collections.abc import Mapping
from pathlib import Path

from ..calibration import Calibration
from ..summaries import VERDICTS, missing_lines, physical_words
from .bars import Bar, bars
from .cells import Cell
from .page import Section, Table
from .rounding import outwards, symbol_text, to_bound, unit_text, upwards


def calibration_section(
    result: Calibration, truth: Mapping[str, float] | None = None, files: list[Path] | None = None
) -> Section:
    """The verdict in a sentence, and the targets."""
    return Section(
        "Calibration with guaranteed bounds",
        [
            VERDICTS[result.verdict].capitalize() + ".",
            f"{result.positions} positions, {result.measurements} readings, σ = {result.noise_bound:.3g} g "
            f"({result.noise_bound_basis}); least possible largest residual {result.radius:.3f} σ.",
            *missing_lines(result),
        ],
        table=target_table(result, truth),
        files=files or [],
    )


def target_section(result: Calibration) -> Section:
    """The targets on a page of their own."""
    said = ["An estimate is never wrong by more than its guaranteed error; the truth lies between low and high."]
    if result.verdict == "falsified":
        said = [
            "The estimates are those of a model that the readings contradict: no value is possible, and no error is "
            "guaranteed. `trihedron diagnose` says what the model lacks."
        ]
    if result.missing:
        said.append(
            "Where there is no number the readings determine none: measure more, or say what is known by `--prior`."
        )
    return Section("Targets", said, table=target_table(result))


def target_table(result: Calibration, truth: Mapping[str, float] | None = None) -> Table:
    """Each target with its interval, drawn in units of σ about its estimate."""
    known = truth or {}
    sigma = result.noise_bound
    falsified = result.verdict == "falsified"

    def over(value: float | None, estimate: float | None) -> float | None:
        return None if value is None or estimate is None else (value - estimate) / sigma

    drawn, reach = bars(
        [
            Bar(
                None if e.guaranteed_error is None or e.estimate is None or falsified else e.guaranteed_error / sigma,
                over(e.low, e.estimate),
                over(e.high, e.estimate),
                over(known.get(e.symbol), e.estimate),
            )
            for e in result.parameters
        ]
    )
    rows: list[list[Cell]] = []
    for e, bar in zip(result.parameters, drawn, strict=True):
        low, high = outwards(e.low, e.high, e.guaranteed_error)
        error = None if e.estimate is None or falsified else upwards(e.guaranteed_error)
        row: list[Cell] = [
            symbol_text(e.symbol),
            physical_words(e.name),
            to_bound(e.estimate, e.guaranteed_error),
            error,
        ]
        row += [bar, low, high, unit_text(e.unit)]
        if truth is not None:
            row.append(to_bound(known.get(e.symbol), e.guaranteed_error))
        rows.append(row)
    header = ["target", "meaning", "estimate", "guaranteed error", "interval", "low", "high", "unit"]
    if truth is not None:
        header.append("truth")
    if falsified:
        dropped = [k for k, name in enumerate(header) if name in ("guaranteed error", "interval", "low", "high")]
        header = [name for k, name in enumerate(header) if k not in dropped]
        rows = [[cell for k, cell in enumerate(row) if k not in dropped] for row in rows]
        return Table(header, rows)
    if reach == 0.0:
        # Nothing is determined: columns without a number say nothing.
        kept = [k for k in range(len(header)) if any(row[k] is not None for row in rows)]
        return Table([header[k] for k in kept], [[row[k] for k in kept] for row in rows])
    marks = "band: estimate and guaranteed error; line: what the readings leave possible; dot: estimate"
    if truth is not None:
        marks += "; bar: truth"
    return Table(header, rows, f"Drawn from −{reach:.2g} to {reach:.2g} σ about each estimate. {marks.capitalize()}.")
