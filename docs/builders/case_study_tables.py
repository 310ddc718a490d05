"""Tables and pictures of the case studies, in Markdown."""

from collections.abc import Sequence
from pathlib import Path

from trihedron.models.effects import CATALOGUE
from trihedron.tools.diagnosis.result import Diagnosis, OrderOfEffects

CAPTIONS = {
    "time": "Error of the carried attitude over time.",
    "quantities": "The same errors against what they may depend on.",
    "order": "Errors of parts that were left out, effect after effect.",
    "gain": "Parts of the record that were not used, without the effects and with them.",
}


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows])


def figure(value: float, digits: int = 3) -> str:
    """A number with so many digits."""
    return f"{value:.{digits}g}"


def order_text(order: OrderOfEffects | None) -> str:
    """An order of effects with the errors that are left, arcminutes."""
    if order is None:
        return "–"
    steps = [f"{step.effect} → {figure(step.held_out_rms_arcmin)}" for step in order.steps]
    return f"{figure(order.held_out_rms_arcmin)}: " + (", ".join(steps) or "nothing helps")


def picture_lines(written: Sequence[Path], stem: str) -> str:
    """The pictures, with their captions."""
    names = [path.stem.removeprefix(f"{stem}-") for path in written]
    return "\n\n".join(
        f"![{CAPTIONS[name]}](pictures/{path.name})\n\n*{CAPTIONS[name]}*"
        for name, path in zip(names, written, strict=True)
    )


def gain_table(result: Diagnosis) -> str:
    """Errors of parts that were not used."""
    assert result.gain is not None
    summary = result.gain.to_json()
    rows = [
        [
            row["over"],
            row["pieces"],
            *(figure(row[f"held_out_{kind}"]) for kind in ("rms_before", "rms_after", "max_before", "max_after")),
        ]
        for row in [summary, *summary["others"]]
    ]
    return table(["over", "pieces", "rms before", "rms after", "largest before", "largest after"], rows)


def cause_table(result: Diagnosis) -> str:
    """The causes with the sizes that the record leaves possible."""
    rows = [
        [cause.place.effect, p.name, f"{value:+.3g}", f"{low:+.3g} to {high:+.3g}", "" if p.unit == "1" else p.unit]
        for cause in result.causes
        for p, value, (low, high) in zip(
            CATALOGUE[cause.place.effect].at(cause.place).parameters, cause.values, cause.intervals, strict=True
        )
    ]
    return table(["effect", "parameter", "estimate", "possible", "unit"], rows)


def excluded_table(result: Diagnosis) -> str:
    """The largest size of each effect of the gyros that the record leaves possible."""
    largest: dict[tuple[str, str], float] = {}
    for entry in result.excluded or ():
        if entry["where"] in ("gyro-block", "attitude-computer"):
            key = (entry["effect"], entry["unit"])
            largest[key] = max(largest.get(key, 0.0), entry["above"])
    rows = [[effect, f"{above:.2g}", "" if unit == "1" else unit] for (effect, unit), above in largest.items()]
    return table(["effect", "excluded above", "unit"], rows)
