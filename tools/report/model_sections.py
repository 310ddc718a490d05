"""What was simulated: the model's equations with their numbers in them."""

from collections.abc import Mapping, Sequence

from ...models.bench import TARGETS
from ...models.effects import CATALOGUE
from ..calibration import Calibration
from ..calibration.correction import Correction
from ..diagnosis import Cause, Diagnosis
from .equations import effect_formula, math, signed
from .page import Section
from .rounding import to_bound

Value = tuple[float | None, float | None]
"""A target's value, None where it is open, and the bound of its error, None where there is none."""

OPEN = "?"
"""In place of a number that the readings do not determine."""

SCALE = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))
CROSS: tuple[tuple[str, ...], ...] = ((), ("X6+X8",), ("X7+X12", "X11+X13"))
BIAS = ("X16", "X17", "X18")


def model_section(result: Calibration, values: Mapping[str, Value], causes: Sequence[Cause] = ()) -> Section:
    """The model with its numbers; an extended one with its effects.

    Parameters
    ----------
    result : Calibration
    values : mapping
        target of case (A1) -> value
    causes : sequence of Cause
        effects of the extended model
    """
    scales = "of either sign" if result.baseline == "asymmetric" else "the same for both signs"
    said = [
        "The bench: a block of three accelerometers with biases, misalignments and scale factors "
        f"{scales}, mounted on a table whose axes are not quite horizontal and perpendicular. n is what the "
        "accelerometers feel, in units of g; angles are in radians. Numbers are rounded to what their guaranteed "
        "errors justify.",
    ]
    if any(value is None for value, _ in values.values()):
        said.append("A question mark stands for what the readings do not determine.")
    if causes:
        said.append("The last lines are the effects by which the model was extended.")
    if len(result.linearised.parametrisation.mountings) > 1:
        said.append(f"Table and mounting as in {result.linearised.parametrisation.mountings[0]}.")
    return Section(
        "What was simulated", said, equations=[*block_lines(values), *bench_lines(values), *cause_lines(causes)]
    )


def calibrated_values(result: Calibration) -> dict[str, Value]:
    """The targets of case (A1): estimates where there are such, else the fit."""
    here = result.linearised
    at_fit = dict(zip(TARGETS, (here.parametrisation.selection[0] @ here.point).tolist(), strict=True))
    found = {e.symbol: (e.estimate, e.guaranteed_error) for e in result.parameters if e.estimate is not None}
    values: dict[str, Value] = {symbol: (value, None) for symbol, value in at_fit.items()}
    return values | found | {gap.symbol: (None, None) for gap in result.missing}


def extended_values(result: Diagnosis) -> dict[str, Value]:
    """The targets with the effects that were found, else those of the nominal model."""
    values = calibrated_values(result.evidence.calibration)
    for target in result.targets or ():
        if target["symbol"] in values:
            ends = target["low"], target["high"]
            half = None if None in ends else 0.5 * (ends[1] - ends[0])
            values[target["symbol"]] = target["after"], half
    return values


def block_lines(values: Mapping[str, Value]) -> list[str]:
    """The three accelerometers."""
    lines = []
    for p in range(3):
        n = f"n_{p + 1}"
        plus, minus = (_text(values[symbol]) for symbol in SCALE[p])
        choice = f"{{{plus} {n} ; 'where' {n} > 0 | {minus} {n} ; 'where' {n} < 0}}"
        own = f"({plus}) {n}" if plus == minus != OPEN else choice
        terms = [f"f_{p + 1}/g = {n} + {own}"]
        terms += [_term(values[symbol], f"n_{k + 1}") for k, symbol in enumerate(CROSS[p])]
        terms.append(_term(values[BIAS[p]], ""))
        lines.append(math(" ".join(terms)))
    return lines


def bench_lines(values: Mapping[str, Value]) -> list[str]:
    """Table and mounting."""
    turn = ", ".join(_text(values[symbol]) for symbol in ("X13", "-X12", "X8"))
    return [
        math("n = exp(ϑ) Q up(α − Δα, β; κ, ε)"),
        math(f"κ = {_text(values['X1'])}, Δα = {_text(values['X2'])}, ε = {_text(values['X3'])}"),
        math(f"ϑ = ({turn})"),
    ]


def cause_lines(causes: Sequence[Cause]) -> list[str]:
    """What each effect adds; none for an effect without a formula."""
    lines = []
    for cause in causes:
        names = [parameter.name for parameter in CATALOGUE[cause.place.effect].at(cause.place).parameters]
        texts = {}
        for name, value, (low, high) in zip(names, cause.values, cause.intervals, strict=True):
            written = to_bound(value, 0.5 * (high - low))
            texts[name] = OPEN if written is None else written.text
        formula = effect_formula(cause.place, texts)
        if formula is not None:
            lines.append(math(formula))
    return lines


def correction_lines(correction: Correction, digits: int) -> list[str]:
    """The correction of readings, with so many decimals."""
    lines = []
    for p in range(3):
        n = f"n_{p + 1}"
        terms = [f"f_{p + 1}/g", signed(-correction.bias[p], f"{abs(correction.bias[p]):.{digits}f}")]
        terms += [signed(-g, f"{abs(g):.{digits}f} n_{c + 1}") for c, g in enumerate(correction.gamma[p, :p].tolist())]
        plus, minus = (f"{scale[p]:.{digits}f}" for scale in (correction.plus, correction.minus))
        lines.append(math(f"{n} = ({' '.join(terms)}) / {{{plus} ; 'where' {n} > 0 | {minus} ; 'where' {n} < 0}}"))
    return lines


def _text(value: Value) -> str:
    written = to_bound(*value)
    return OPEN if written is None else written.text


def _term(value: Value, of: str) -> str:
    text = _text(value)
    return f"{'−' if text.startswith('−') else '+'} {text.lstrip('−')} {of}"
