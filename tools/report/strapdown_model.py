"""What was simulated of a strapdown record: the equations of block and attitude with their numbers in them."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from ...models.effects import CATALOGUE
from ...models.effects.motion_rows import matrix_formula
from ..diagnosis.result import Cause, Diagnosis
from ..motion.norm import COLUMNS, ROWS
from .equations import effect_formula, math
from .model_sections import OPEN, Value
from .page import Section
from .rounding import to_bound
from .strapdown_text import parameters_of

AXES = ("1", "2", "3")

_OWN = re.compile(r"(?P<sensor>accelerometer|gyro) (?P<kind>gamma|bias)_(?P<first>\d)(?P<second>\d?)")


def own_words(name: str) -> str:
    """A parameter of the block in words: "gyro gamma_12" is the misalignment of gyro 1 towards axis 2."""
    match = _OWN.fullmatch(name)
    if match is None:
        return name
    sensor = f"{match['sensor']} {match['first']}"
    if match["kind"] == "bias":
        return f"bias of {sensor}"
    same = match["first"] == match["second"]
    return f"scale factor of {sensor}" if same else f"misalignment of {sensor} towards axis {match['second']}"


def model_section(result: Diagnosis) -> Section:
    """Block, attitude and effects; those of the first set where the result names one."""
    values = own_values(result)
    gravity = result.reference == "gravity"
    named = result.causes if result.verdict == "explained" else ()
    said = [
        f"A block of three gyros{' and three accelerometers' if gravity else ''}, {own_errors(result)}. Its readings "
        "are taken back to rates by the inverse of these equations, and the rates carry the attitude q. n is the "
        "specific force in units of g, ω the rate in rad/s, both in the block's axes."
    ]
    if values:
        said.append("Numbers are rounded to what their intervals justify.")
    if named:
        said.append("The last lines are the effects by which the simulation was extended.")
    lines = []
    if gravity:
        lines += [math(f"f/g = n + {triangle(values)} n + {vector('accelerometer bias', values)} + Δf/g")]
    lines += [math(gyro_line(result, values)), math("dq/dt = q ∘ ω / 2")]
    if gravity:
        lines += [math("n 'at rest' = q⁻ ∘ up ∘ q")]
    return Section("What was simulated", said, equations=[*lines, *effect_lines(named)])


def own_errors(result: Diagnosis) -> str:
    """What belongs to the block itself, in words."""
    if result.bias_at_rest is not None:
        return "taken as delivered: their mean at rest is taken out, and nothing else"
    free = "biases, scale factors and misalignments" if result.baseline_model == "calibrated" else "biases"
    return f"whose {free} are free to be what the record says"


def own_values(result: Diagnosis) -> dict[str, Value]:
    """The block's own parameters: name -> value and half of its interval, None where there is none."""
    return {
        p.name: (p.estimate, None if p.low is None or p.high is None else 0.5 * (p.high - p.low))
        for p in parameters_of(result)
    }


def gyro_line(result: Diagnosis, values: Mapping[str, Value]) -> str:
    """What the gyros read."""
    terms = ["ω_read = ω"]
    if "gyro gamma_11" in values:
        own = {f"gamma_{p}{q}": number(values[f"gyro gamma_{p}{q}"]) for p in AXES for q in AXES}
        terms.append(f"+ {matrix_formula('gamma', AXES).format(**own)} ω")
    if result.bias_at_rest is not None:
        bounds = result.evidence.found.rests.rate_bound
        near = [None] * 3 if bounds is None else [float(b) for b in np.median(bounds, axis=0)]
        # It is no parameter that is fitted: the noise at rest says how well it is known.
        at_rest = {f"gyro bias_{p + 1}": (float(result.bias_at_rest.radps[p]), near[p]) for p in range(3)}
        terms.append(f"+ {vector('gyro bias', at_rest)}")
    elif "gyro bias_1" in values:
        terms.append(f"+ {vector('gyro bias', values)}")
    return " ".join([*terms, "+ Δω"])


def vector(name: str, values: Mapping[str, Value]) -> str:
    """Three numbers, one for each axis."""
    return f"({', '.join(number(values.get(f'{name}_{p}', (None, None))) for p in (1, 2, 3))})"


def triangle(values: Mapping[str, Value]) -> str:
    """The accelerometers' matrix: its first axis is the first accelerometer's, so that nothing stands above."""
    below = {(int(r), int(c)) for r, c in zip(ROWS, COLUMNS, strict=True)}
    rows = (
        " ; ".join(
            number(values.get(f"accelerometer gamma_{r + 1}{c + 1}", (None, None))) if (r, c) in below else "0"
            for c in range(3)
        )
        for r in range(3)
    )
    return f"[{' | '.join(rows)}]"


def number(value: Value) -> str:
    """A number as its bound justifies it, or the sign for one that is open."""
    written = to_bound(*value)
    return OPEN if written is None else written.text


def effect_lines(causes: Sequence[Cause]) -> list[str]:
    """What each effect adds, as MathML."""
    lines = []
    for cause in causes:
        names = [parameter.name for parameter in CATALOGUE[cause.place.effect].at(cause.place).parameters]
        numbers = {
            name: number((value, 0.5 * (high - low)))
            for name, value, (low, high) in zip(names, cause.values, cause.intervals, strict=True)
        }
        formula = effect_formula(cause.place, numbers)
        if formula is not None:
            lines.append(math(formula))
    return lines
