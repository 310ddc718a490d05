"""Options that several functions share, with their meaning and their form at a terminal.

A function of the library has the type of an option as its annotation and does not describe it. `completed` adds the
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
    from .result import Result as Noise
else:
    ArrayLike, Diagnosis, Noise = Any, Any, Any


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
        "σ: bound of the error of one averaged reading, as a fraction of g. Three standard deviations fit 100 "
        "positions. Without it and --noise-sd, the record must give it."
    ),
]
SetValues = Annotated[
    Sequence[str],
    Option("Value of a parameter or input, as mass=2.5 or element.mass=2.5. Repeat it for several.", name="--set"),
]
InputTable = Annotated[
    str | Path | None,
    Option(
        "Table of inputs (CSV): times, then a column for each input by its name. Continuous inputs are linear between "
        "rows, as in FMPy and fmusim.",
        name="--input",
        typed=Path | None,
    ),
]
Live = Annotated[
    int | str | None,
    Option(
        "Show the run while it goes on: port of a page for this machine alone (0: any), or - for rows (CSV) on "
        "standard output.",
        typed=str | None,
    ),
]
NoiseSd = Annotated[
    float | None,
    Option(
        "Standard deviation of the error of one averaged reading, as a fraction of g. It replaces σ by an estimate: "
        "2.5 times as large for 24 positions, 2.7 for 48, 3 for 100."
    ),
]
NoiseResult = Annotated[
    str | Path | Noise | None,
    Option(
        "Result of `trihedron noise` (JSON). It gives the standard deviation for the record's dwell, as --noise-sd "
        "does.",
        name="--noise",
        typed=Path | None,
    ),
]
Gravity = Annotated[float, Option("Model value of gravity [m/s²].")]
Convention = Annotated[Literal["A1", "A2"], Option("Form of the matrix Γ. A1: lower triangular; A2: symmetric.")]
Baseline = Annotated[
    Literal["asymmetric", "symmetric"],
    Option("Scale factors of each accelerometer: two (by the sign of its input) or one."),
]
Admissible = Annotated[
    Literal["paper", "tables"],
    Option("Admissible set: (1.7) of the paper, or with the bias rows behind its published tables."),
]
Bounds = Annotated[
    tuple[float, float], Option("u^max and v0^max of (1.7): they decide which inputs have a certain sign.")
]
Mounting = Annotated[
    str | Mapping[str, ArrayLike],
    Option("Mounting of the block: a preset, or a TOML file with [name] matrix = [[...], ...].", typed=str),
]
Channels = Annotated[
    Sequence[str],
    Option(
        "Order, signs and units of the file's channels. 2,1,-3: axis 1 is f2, axis 3 is f3 reversed. Further: w=2,1,-3 "
        "(gyros), alpha=-1, beta=-1, angles=rad, w=deg. Repeat it for several.",
        name="--channels",
    ),
]
Stamps = Annotated[
    str | None,
    Option(
        "Time stamps of a record with gyros. even: one period between rows, gaps kept; logged: as they stand. A "
        "sampling rate [Hz] replaces them. By default the stamps that fit gyros and gravity better."
    ),
]
Without = Annotated[
    str,
    Option("Rows to leave out of a table of averaged readings, or rests of a raw record, by number, as 42 or 6,19-30."),
]
Trust = Annotated[
    bool,
    Option("Use a record with gyros although its units, axes, signs or rows look wrong. Each fault becomes a warning."),
]
Rates = Annotated[
    Literal["instantaneous", "averaged"],
    Option("Meaning of a rate: of the instant, or the average since the last row."),
]
RestScatter = Annotated[
    float | None,
    Option(
        "Largest scatter of an accelerometer at rest, as a multiple of its noise. Default: 3, or 5 if 3 leaves too few "
        "rests."
    ),
]
RestsFile = Annotated[
    str | Path | None,
    Option(
        "File of the rests (CSV), with the columns from_s, to_s and, if known, face.",
        typed=Path | None,
    ),
]
Faces = Annotated[
    str | None,
    Option(
        "Axis of the case that points up at each rest, in order: +1,-1,+2,-2,+3,-3. The columns face and part can give "
        "it, too."
    ),
]
Turns = Annotated[
    str | None,
    Option(
        "Known turns, in order, as axis:degrees by the right hand: 1:360,2:360,3:-360. 360 alone: every turn is a "
        "whole one. The columns turn and part can give them, too."
    ),
]
EffectsFrom = Annotated[
    str | Path | None,
    Option(
        "Your own effects, a Python file like those in models/effects. The program runs and checks it, then adds its "
        "effects to the catalogue.",
        typed=Path | None,
    ),
]
Platform = Annotated[
    str | None, Option("Platform of native FMUs: host (the default), all, or a name: aarch64-linux, x86_64-windows.")
]
SspVersion = Annotated[Literal["1.0", "2.0"], Option("Version of SSP; more tools read 1.0.", name="--ssp")]
BridgeGaps = Annotated[
    int, Option("Longest gap to bridge [rows], 10 at most. The result bounds the attitude error of the gaps.")
]
Targets = Annotated[Sequence[str], Option("Further target: X4, X4-X5. Repeat it for several.", name="--target")]
Shared = Annotated[
    Sequence[str],
    Option(
        "Parameter with one value in all records, beside scale factors and misalignments: bias-1, X16, bias-*. Repeat "
        "it for several.",
        name="--shared",
    ),
]
Own = Annotated[
    Sequence[str],
    Option(
        "Parameter with its own value in each record, beside biases, mounting and table: misalignment-*. Repeat it for "
        "several.",
        name="--own",
    ),
]
ExplainedBy = Annotated[
    str | Path | Diagnosis | None,
    Option(
        "Diagnosis (JSON): its wrong rows are left out; its breaks and effects are solved together with the "
        "parameters. In the record of the diagnosis their sizes are unknown; in another record its intervals hold.",
        name="--with",
        typed=Path | None,
    ),
]
RecordBaseline = Annotated[
    Literal["asymmetric", "symmetric", "calibrated", "nominal"] | None,
    Option(
        "Model to start from. Position record: scale factors asymmetric (default) or symmetric. Strapdown record: "
        "gyros calibrated (default with gravity as the reference) or nominal (default with the true attitude)."
    ),
]
ReferenceBound = Annotated[
    float | None,
    Option(
        "Largest error of the true attitude in any row of a strapdown record [arcmin]. Without it the error at rest "
        "counts. The causes are as certain as this bound."
    ),
]
Extend = Annotated[
    bool,
    Option(
        "Extend the model by a formula or table where place and quantity are proven, even if an effect of the "
        "catalogue also fits."
    ),
]
PLACES = "give a port, 0 for any free one, or - for rows on standard output"
"""What `--live` takes."""
ExportTarget = Literal["kalibr", "imucal", "ros", "c", "matlab", "csv", "xlsx", "imu_tk", "px4"]
"""Programs and formats for which a calibration is exported."""
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
