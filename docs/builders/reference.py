"""Reference pages and the picture of the README, made from the source: `python docs/builders/reference.py DOCS`."""

import math
import sys
from pathlib import Path

from effect_pictures import effect_sheet
from explanation_pictures import interval_picture, strips_picture
from trihedron.fmus import components
from trihedron.fmus.component import Component, Variable
from trihedron.fmus.units import UNITS
from trihedron.models.effects import CATALOGUE, Effect, EffectParameter
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.files import write_text
from trihedron.tools.reports.evidence import residual_sections
from trihedron.tools.trials.bench import NOISE_BOUND
from trihedron.tools.trials.draw import draw_alone

PICTURE_SEED = 2026
"""Of the record that the README shows: the demo's."""


EFFECTS_INTRODUCTION = (
    "What each does to the readings of accelerometers 1 (solid), 2 (dashed) and 3 (dotted) of a perfect bench, over",
    "its size; a dead zone of 0.2 g, saturation at 0.8 g and rounding to 0.2 g; harmonics of second order.",
    "",
    "![Effects](pictures/effects.svg)",
)
"""What stands above the table of effects."""


def reference_page() -> str:
    """The components with their variables, and the catalogue of effects, in Markdown."""
    parts = [
        "# Reference: components and effects",
        "",
        "Made from the source by `make docs`; do not edit.",
        "",
    ]
    for component in components().values():
        parts += component_lines(component)
    parts += [
        "## Effects",
        "",
        *EFFECTS_INTRODUCTION,
        "",
        "| effect | what it adds | places | parameters | extends |",
        "|---|---|---|---|---|",
    ]
    parts += [effect_line(effect) for effect in CATALOGUE.values()]
    return "\n".join([*parts, ""])


def component_lines(component: Component) -> list[str]:
    """A component's equations and its table of variables."""
    return [
        f"## {component.name}",
        "",
        f"{component.description}. Source: {component.source}.",
        "",
        *(f"    {line}" for line in component.equations),
        "",
        "| variable | causality | variability | unit | start | meaning |",
        "|---|---|---|---|---|---|",
        *(variable_line(variable) for variable in component.interface),
        "",
        "It stops with a message when: " + "; ".join(component.messages) + ".",
        "",
    ]


def variable_line(variable: Variable) -> str:
    """A row of the table of variables."""
    name = f"`{variable.name}[1..{variable.size}]`" if variable.size else f"`{variable.name}`"
    unit = UNITS[variable.unit].name if variable.type == "real" and variable.unit != "1" else variable.type
    unit = "" if unit == "real" else unit
    start = ""
    if variable.causality != "output":
        values = variable.starts if len(set(variable.starts)) > 1 else variable.starts[:1]
        start = ", ".join(f"{value:g}" for value in values)
    return f"| {name} | {variable.causality} | {variable.variability} | {unit} | {start} | {variable.description} |"


def effect_line(effect: Effect) -> str:
    """A row of the table of effects."""
    places: dict[str, list[str]] = {}
    parameters: dict[str, EffectParameter] = {}
    for place in effect.places:
        words = place.title.removeprefix(effect.name).strip().removeprefix(place.where).strip()
        places.setdefault(place.where, []).extend([words] if words else [])
        parameters.update({p.name: p for p in effect.at(place).parameters})
    where = "; ".join(f"{name} ({', '.join(words)})" if words else name for name, words in places.items())
    alike: dict[tuple[str, float], list[str]] = {}
    for p in parameters.values() or effect.parameters:
        alike.setdefault((p.unit, p.largest), []).append(p.name)
    said = ", ".join(
        f"{', '.join(names)} [{unit}], at most {largest if largest != math.pi else 'π'}"
        for (unit, largest), names in alike.items()
    )
    adds = formula_text(effect)
    return f"| `{effect.name}` | {adds} | {where or 'any reading'} | {said} | {effect.component or 'nothing'} |"


def formula_text(effect: Effect) -> str:
    """What an effect adds, with its parameters' names; where it differs between the places, each formula."""
    letters = {"p": "p", "i": "i", "j": "j", "angle": "angle", "order": "order"}
    names = {p.name: p.name for place in effect.places for p in effect.at(place).parameters}
    names |= {p.name: p.name for p in effect.parameters}
    formulas = dict.fromkeys(effect.at(place).formula for place in effect.places or ())
    texts = [
        formula.format(**letters, **names).replace("'", "").replace("(phase)", "phase")
        for formula in formulas or {effect.formula: None}
    ]
    return "; ".join(text.replace("|", "\\|").replace("_", "\\_").replace("*", "\\*") for text in texts if text)


def readme_picture() -> str:
    """Residuals of a record with a hidden effect, before and after the simulation was extended (SVG)."""
    record = draw_alone(PICTURE_SEED, effects=["quadratic"]).measured()
    sections = residual_sections(diagnose(record, noise_bound=NOISE_BOUND, rerun=False))
    return sections[0].svg or ""


def main(arguments: list[str]) -> None:
    """Write reference.md and its pictures into the folder that is named."""
    docs = Path(arguments[0]) if arguments else Path("docs")
    write_text(docs / "reference.md", reference_page())
    write_text(docs / "pictures" / "residuals.svg", readme_picture())
    write_text(docs / "pictures" / "effects.svg", effect_sheet())
    write_text(docs / "pictures" / "strips.svg", strips_picture())
    write_text(docs / "pictures" / "intervals.svg", interval_picture())


if __name__ == "__main__":
    main(sys.argv[1:])
