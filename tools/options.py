"""Options that several functions share, with their meaning and their form at a terminal.

A function of the library has the type of an option as its annotation and does not describe it; `completed` adds the
words to its docstring, and the command line takes name, type and words from it.
"""

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from .result import Result as Diagnosis
else:
    ArrayLike, Diagnosis = Any, Any


@dataclass(frozen=True)
class Option:
    """An option of several functions.

    Attributes
    ----------
    words : str
        its meaning
    name : str
        its name at a terminal, if that differs from the parameter's
    typed : type or None
        its type at a terminal, if Python accepts more
    """

    words: str = ""
    name: str = ""
    typed: Any = None


NoiseBound = Annotated[
    float | None,
    Option(
        "σ: bound of one averaged reading's error, as a fraction of g: three standard deviations for 100 positions. "
        "Without it, or --noise-sd, the record must tell."
    ),
]
NoiseSd = Annotated[
    float | None,
    Option(
        "Standard deviation of one averaged reading's error, as a fraction of g, in the place of σ: σ is 2.5 times as "
        "large for 24 positions, 2.7 for 48, 3 for 100, and estimated."
    ),
]
Gravity = Annotated[float, Option("Model value of gravity [m/s²].")]
Convention = Annotated[Literal["A1", "A2"], Option("A1: Γ lower triangular; A2: symmetric.")]
Baseline = Annotated[Literal["asymmetric", "symmetric"], Option("Two scale factors for each accelerometer, or one.")]
Admissible = Annotated[
    Literal["paper", "tables"],
    Option("(1.7) as printed, or with the bias rows, as the published tables were computed."),
]
Bounds = Annotated[tuple[float, float], Option("u^max and v0^max of (1.7): when the sign of an input is certain.")]
Mounting = Annotated[
    str | Mapping[str, ArrayLike],
    Option("Name of a preset, or a TOML file with [name] matrix = [[...], ...].", typed=str),
]
Channels = Annotated[
    Sequence[str],
    Option(
        "How the file's channels are read: 2,1,-3 (accelerometers: axis 1 is the file's f2, axis 3 its f3 reversed), "
        "w=2,1,-3 (gyros), alpha=-1, beta=-1, angles=rad, w=deg; may be repeated.",
        name="--channels",
    ),
]
Stamps = Annotated[
    str | None,
    Option(
        "Time stamps of a record with gyros: even (one period between rows, gaps kept), logged, or the sampling rate "
        "[Hz], by which rows are counted whatever their stamps. Without it, of uneven stamps those under which gyros "
        "and gravity agree better."
    ),
]
Trust = Annotated[
    bool,
    Option(
        "Use a record with gyros although its units, axes, signs or single rows look wrong: what speaks against it is "
        "then a warning."
    ),
]
Rates = Annotated[Literal["instantaneous", "averaged"], Option("What a rate in the record means.")]
EffectsFrom = Annotated[
    str | Path | None,
    Option(
        "A file of effects of your own (Python, as in models/effects): it is run, checked, and its effects are known "
        "beside those of the catalogue.",
        typed=Path | None,
    ),
]
Platform = Annotated[
    str | None, Option("Of native FMUs: host (the default), all, or a name as aarch64-linux or x86_64-windows.")
]
BridgeGaps = Annotated[
    int, Option("Bridge gaps of up to so many lost rows, 10 at most; the attitude error that may cause is bounded.")
]
Targets = Annotated[Sequence[str], Option("Another combination, as X4-X5; may be repeated.", name="--target")]
Shared = Annotated[
    Sequence[str],
    Option(
        "Of several records: a parameter that has one value in all, beside scale factors and misalignments, as bias-1 "
        "or X16; a star stands for anything; may be repeated.",
        name="--shared",
    ),
]
Own = Annotated[
    Sequence[str],
    Option(
        "Of several records: a parameter that each record has of its own, beside biases, mounting and table, as "
        "misalignment-*; may be repeated.",
        name="--own",
    ),
]
ExplainedBy = Annotated[
    str | Path | Diagnosis | None,
    Option(
        "A diagnosis (JSON): the effects that it names are solved with the parameters in one programme. Of this record "
        "their sizes are unknown, of another one they are within the diagnosis' intervals.",
        name="--with",
        typed=Path | None,
    ),
]
RecordBaseline = Annotated[
    Literal["asymmetric", "symmetric", "calibrated", "nominal"] | None,
    Option(
        "Of a position record: asymmetric (the default) or symmetric scale factors. Of a strapdown record: the gyros "
        "calibrated (the default where gravity is the reference) or nominal (where the true attitude is known)."
    ),
]
ReferenceBound = Annotated[
    float | None,
    Option(
        "Bound of the true attitude's error at any row of a strapdown record [arcmin], where you know it; without it "
        "the true attitude is taken to err as at rest. What is named with it is as sure as it is."
    ),
]
Extend = Annotated[
    bool,
    Option(
        "Where place and quantity are proven, extend the model by a formula or a table that is in no catalogue, though "
        "something in it stands, too."
    ),
]
Progress = Annotated[bool, Option("Show a bar on standard error, where that is a terminal.")]


def option_of(annotation: Any) -> Option | None:
    """Return the option that an annotation names, if any."""
    if get_origin(annotation) is Annotated:
        for part in get_args(annotation)[1:]:
            if isinstance(part, Option):
                return part
    return None


def docstring_words(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Return the text before the sections of a numpydoc docstring, and the words of each parameter.

    A parameter's words in the docstring override those of its option.
    """
    head, parameters, _ = _parts(function)
    words = {}
    for name, parameter in inspect.signature(function).parameters.items():
        if option := option_of(parameter.annotation):
            words[name] = option.words
    for entry in parameters:
        title, text = entry.split("\n", 1)
        for name in title.split(" : ")[0].split(", "):
            words[name] = " ".join(text.split())
    return head, words


def completed(function: Callable[..., Any]) -> str:
    """Return the docstring of a function with the options that it shares, in the order of the signature."""
    head, parameters, rest = _parts(function)
    entries = {}
    for entry in parameters:
        for name in entry.split("\n")[0].split(" : ")[0].split(", "):
            entries[name] = entry
    for name, parameter in inspect.signature(function).parameters.items():
        option = option_of(parameter.annotation)
        if option is not None and name not in entries:
            kind = inspect.formatannotation(get_args(parameter.annotation)[0])
            entries[name] = f"{name} : {kind}\n    {option.words}"
    ordered = [entries[name] for name in inspect.signature(function).parameters if name in entries]
    section = "Parameters\n----------\n" + "\n".join(dict.fromkeys(ordered))
    return "\n\n".join([head, section, *rest] if ordered else [head, *rest])


def _parts(function: Callable[..., Any]) -> tuple[str, list[str], list[str]]:
    """Split a numpydoc docstring: the text before the sections, the entries of the parameters, the other sections."""
    head, *sections = re.split(r"\n\n(?=\w+\n-{3,}\n)", inspect.getdoc(function) or "")
    if not sections or not sections[0].startswith("Parameters\n"):
        return head, [], sections
    entries = re.findall(r"(?m)^\w.*\n(?:    .*\n?)+", sections[0].split("\n", 2)[2])
    return head, [entry.rstrip() for entry in entries], sections[1:]
