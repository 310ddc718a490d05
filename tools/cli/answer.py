"""Input and output of a command: options, text for a person, JSON for a program, exit status.

Options are the library's functions' with their words, and what only a command line needs.
"""

import errno
import inspect
import os
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from dataclasses import dataclass, replace
from importlib.util import find_spec
from io import StringIO, TextIOWrapper
from pathlib import Path
from shutil import get_terminal_size
from time import monotonic
from typing import Annotated, Any, TextIO, TypeVar, get_args, get_origin

from cyclopts import CycloptsError, Parameter

from .. import document, reports
from ..errors import InputError, full, one_line, shortage
from ..files import inputs_kept, json_text, ordinary_file, ordinary_folder, together, write_text
from ..options import Option, docstring_words, option_of

if sys.platform == "win32":
    resource = None
else:
    import resource

Command = TypeVar("Command", bound=Callable[..., object])
NOT_ALLOWED = (errno.EACCES, errno.EPERM, errno.EROFS, errno.ENAMETOOLONG, errno.ENOTDIR, errno.EISDIR, errno.EEXIST)
"""Errors of the system about a file or folder that the user named; every other one is a fault of the program."""

LEAST_MEMORY = 1 << 30
"""Bytes of addresses without which libraries do not load, or end the process."""
LONG_S = 20.0
"""Time without numba after which a hint names it [s]."""
INTERRUPTED = 130
"""128 and the number of the signal, as shells count."""
COLOURS = {"good": "bold green", "attention": "bold yellow", "neutral": "bold"}
"""Style of a verdict on a terminal, by the tone of its page."""
STANDARD_OUTPUT = Path("-")
"""Where `--json -` writes: the object takes the place of the text."""


@dataclass(frozen=True)
class Answer:
    """The output of a command, and its exit status.

    The text is printed with --quiet too where it is `wanted`: asked for by name. A complaint is one line for standard
    error, where the work was done and found something wrong.
    """

    text: str
    wanted: bool = False
    complaint: str = ""
    status: int = 0
    result: Any = None
    """the result with a verdict that the text shows; None of an object or a list of files"""
    tone: str = "neutral"
    head: str = ""
    """the verdict, with which the text begins"""


def answer(
    result: Any,
    json: Path | None,
    content: Mapping[str, Any] | None = None,
    *,
    files: Iterable[Path | str] = (),
    complaint: str = "",
    status: int = 2,
) -> Answer:
    """Write a command's JSON where `--json` asks for it ("-": standard output), and return the output to print.

    A person reads the `result`, which may be text, and the `files` that were written, a line each. The object is the
    `content`, plain values, or that of the result. The exit status is `status` where there is a complaint. An
    InputError where the file cannot be written.
    """
    if not complaint:
        status = 0
    if json is not None:
        text = json_text(result.to_json() if content is None else content)
        if json == STANDARD_OUTPUT:
            return Answer(text.rstrip("\n"), wanted=True, complaint=complaint, status=status)
        write_text(json, text)
    page = None if isinstance(result, str) else reports.page_of(result)
    text = str(result) if page is None else document.text(page, terminal_width())
    shown = Answer("\n".join([text, *map(str, files)]), complaint=complaint, status=status)
    if page is None:
        return shown
    head, _, _ = shown.text.partition("\n\n" if page.screen else "\n")
    return replace(shown, result=result, tone=page.tone, head=head)


def terminal_width() -> int | None:
    """Return the columns of the terminal; None where the output is none."""
    return get_terminal_size().columns if sys.stdout.isatty() else None


class Silenced(StringIO):
    """Swallows the words of a command; `beneath` takes output that was asked for by name."""

    def __init__(self, beneath: TextIO) -> None:
        super().__init__()
        self.beneath = beneath


def say(command: Callable[[], object], *, quiet: bool) -> int:
    """Run a command, print its answer unless it has printed itself, and return its exit status.

    Its files appear together when it is done, or none of them.

    `quiet`: print no text, no bars and no warnings; only output that was asked for by name.
    """
    began = monotonic()
    with ExitStack() as silent:
        if quiet:
            silent.enter_context(redirect_stdout(Silenced(sys.stdout)))
            silent.enter_context(redirect_stderr(StringIO()))
        with inputs_kept(), together():
            outcome = command()
    if not quiet and monotonic() - began > LONG_S and find_spec("numba") is None:
        print("trihedron[fast], which brings numba, makes searches and long runs faster", file=sys.stderr)
    if not isinstance(outcome, Answer):
        return 0
    if outcome.text and (outcome.wanted or not quiet):
        _print(outcome)
    if outcome.complaint:
        print(f"trihedron: {one_line(outcome.complaint)}", file=sys.stderr)
    return outcome.status


def _print(outcome: Answer) -> None:
    """Print an answer, its verdict in colour on a terminal, unless NO_COLOR is set."""
    if not outcome.head or os.environ.get("NO_COLOR") or not sys.stdout.isatty():
        print(outcome.text)
        return
    from rich.console import Console
    from rich.text import Text

    text = Text(outcome.text)
    text.stylize(COLOURS[outcome.tone], 0, len(outcome.head))
    console = Console(highlight=False)
    for line in text.split(allow_blank=True):
        # A row of a table, and a command to copy, stay one line; a command within a sentence need not.
        outside = re.sub(r"`[^`]*`", "`", line.plain)
        console.print(line, soft_wrap="  " in outside or "trihedron" in outside)


def exit_status(command: Callable[[], int]) -> int:
    """Run a command, which prints its results and gives 0, or another status where it has found something wrong.

    Else: 2: the input cannot be used, said in one line; 1: a fault of the program's own; 130: interrupted.
    """
    if isinstance(sys.stdout, TextIOWrapper):
        # A terminal or pipe that knows no Greek gets \u03c3 for σ instead of nothing at all.
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        status = command()
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except (InputError, CycloptsError) as error:
        return refuse(str(error), error.lines if isinstance(error, InputError) else ())
    except KeyboardInterrupt as error:
        print(f"trihedron: {one_line(str(error)) or 'interrupted'}", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        drop_output()
        return 0
    except OSError as error:
        if error.filename is not None and (full(error) or error.errno in NOT_ALLOWED):
            return refuse(f"{error.filename}: cannot be used ({error.strerror})")
        if advice := no_working_folder():
            return refuse(advice)
        if not full(error):
            return fault(error)
        drop_output()
        return refuse(f"standard output: cannot be written ({error.strerror})")
    except SystemExit as stop:
        return int(stop.code or 0)
    except Exception as error:
        return fault(error)
    except BaseException as error:
        # A library in Rust raises this for an unexpected case.
        if type(error).__name__ != "PanicException":
            raise
        return fault(RuntimeError(str(error)))


def no_working_folder() -> str:
    """Return what to do where the working folder was deleted; empty where it is there."""
    try:
        Path.cwd()
    except OSError as error:
        return f"the working folder cannot be used ({error.strerror}); it may be deleted: change to another one (cd)"
    return ""


def too_little_memory() -> str:
    """Return what to do where the limit of memory lets no library load; empty where there is enough, or no limit."""
    if resource is None:
        return ""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY or limit >= LEAST_MEMORY:
        return ""
    return f"the limit of memory is {limit >> 20} MiB; give at least {LEAST_MEMORY >> 20} MiB (ulimit -v)"


def drop_output() -> None:
    """Discard the buffer of standard output; otherwise Python writes it at exit and complains."""
    if sys.stdout is not None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def refuse(message: str, lines: Sequence[str] = ()) -> int:
    """Print a line on standard error with the reason why the input cannot be used, or several with questions."""
    text = "\n".join(one_line(line) if line[:1] != " " else f"  {one_line(line)}" for line in lines)
    print(f"trihedron: {text or one_line(message)}", file=sys.stderr)
    return 2


def fault(error: Exception) -> int:
    """Print a line on standard error for an error of the program itself."""
    if os.environ.get("TRIHEDRON_TRACEBACK"):
        raise error
    if advice := shortage(error):
        return refuse(advice)
    message = one_line(f"{type(error).__name__}: {error}")
    print(f"trihedron: a fault of the program: {message} (TRIHEDRON_TRACEBACK=1 shows where)", file=sys.stderr)
    return 1


def json_file(_: object, path: Path | None) -> None:
    """Refuse an option in place of the name of a JSON file; "-" is standard output."""
    if path is not None and str(path).startswith("-") and str(path) != "-":
        raise InputError(f"--json {path}: is an option; give the name of a file, or - for standard output")
    if str(path) != "-":
        ordinary_file(None, path)


def distinct_files(files: dict[str, Path | None]) -> None:
    """Refuse a result that would be written over the record or over another result."""
    names: dict[str, str] = {}
    for name, path in files.items():
        if path is not None:
            first = names.setdefault(os.path.realpath(path), name)
            if first != name:
                raise InputError(f"{name} {path}: is {first} too; give another name")


def page_file(option: str) -> Callable[[object, Path | None], None]:
    """Return a check of the name of a page, to run before any computation."""

    def checked(_: object, path: Path | None) -> None:
        if path is not None:
            document.report_file(path, option)

    return checked


File = Annotated[Path | None, Parameter(validator=ordinary_file)]
Folder = Annotated[Path | None, Parameter(name="--out", validator=ordinary_folder)]
JsonFile = Annotated[
    Path | None,
    Parameter(
        name="--json",
        allow_leading_hyphen=True,
        help="Write the result as JSON to this file; - prints it in place of the text.",
        validator=json_file,
    ),
]
ReportFile = Annotated[
    Path | None,
    Parameter(
        name="--report", help="Write a page with pictures to this file, .html or .pdf.", validator=page_file("--report")
    ),
]
SheetFile = Annotated[
    Path | None,
    Parameter(
        name="--sheet",
        help="Write a certificate of one A4 page to sign, .html or .pdf.",
        validator=page_file("--sheet"),
    ),
]
PlotFile = Annotated[
    Path | None,
    Parameter(
        name="--plot",
        help="Write the columns as lines over time to this page, .html or .pdf.",
        validator=page_file("--plot"),
    ),
]
Number = Annotated[float, Parameter(allow_leading_hyphen=True)]

Whole = Annotated[int, Parameter(allow_leading_hyphen=True)]

NAMES = {
    "duration_s": "--duration",
    "dwell_s": "--dwell",
    "effects": "--effect",
    "hypotheses": "--hypothesis",
    "patience_s": "--patience",
    "priors": "--prior",
    "reserve_deg": "--reserve",
    "resolution_deg": "--resolution",
    "targets": "--target",
}
"""Options whose names at a terminal are not those of the parameters."""
WITH_HYPHEN = ("channels", "live", "own", "priors", "shared", "targets")
"""Options whose words may begin with a hyphen, as -X12."""
CHECKED: dict[str, Any] = {
    "mounting": str,
    "mountings": Annotated[
        tuple[str, ...],
        Parameter(name=("--mountings", "--mounting"), consume_multiple=(1, None), show_default=False),
    ],
    "out": Folder,
    "plot": PlotFile,
}
"""Options that a terminal checks before anything is computed, or takes in another form."""
NOT_TYPED = ("progress", "gyro_bias", "bench")
"""Parameters that the command line does not offer: a command shows its progress, and a terminal has no arrays."""


def with_options_of(*functions: Callable[..., Any]) -> Callable[[Command], Command]:
    """Give a command the options of functions of the library: names, types, defaults, words.

    The functions are those of `trihedron.tools.library`, `measured` and `at_table`, documented by numpydoc. The
    command has its own parameters first, by position, and its own options last; ``**options`` are those of the
    functions. Its docstring holds the examples; the sentence is the first function's, and the words of a parameter are
    those of the first that has it. A command without a function has its own sentence, and the words of shared options.
    """

    def with_options(command: Command) -> Command:
        first, last, options = [], [], {}
        examples, own_words = docstring_words(command)
        for p in inspect.signature(command).parameters.values():
            if p.kind is p.KEYWORD_ONLY:
                if option_of(p.annotation):
                    p = p.replace(annotation=typed(p))
                    command.__annotations__[p.name] = p.annotation
                last.append(p)
            elif p.kind is not p.VAR_KEYWORD:
                first.append(p)
        excluded = {*NOT_TYPED, *(p.name for p in (*first, *last))}
        texts: dict[str, str] = {}
        for function in functions:
            words = docstring_words(function)[1]
            for name, p in inspect.signature(function).parameters.items():
                if name in words:
                    texts.setdefault(name, words[name])
                if p.kind is p.KEYWORD_ONLY and name not in excluded:
                    options.setdefault(name, p.replace(annotation=typed(p)))
        signature = inspect.Signature([*first, *options.values(), *last])
        command.__signature__ = signature  # type: ignore[attr-defined]
        lines = ["Parameters", "----------"]
        for name, text in (texts | own_words).items():
            if name in signature.parameters:
                lines += [name, f"    {text}"]
        parts = [*[docstring_words(function)[0] for function in functions[:1]], examples]
        command.__doc__ = "\n\n".join([*parts, "\n".join(lines)] if len(lines) > 2 else parts)
        return command

    return with_options


def typed(parameter: inspect.Parameter) -> Any:
    """The type of a parameter of the library as a terminal has it: its name, and whether a hyphen may begin it."""
    name = parameter.name
    if name in CHECKED:
        return CHECKED[name]
    option = option_of(parameter.annotation) or Option()
    kind = get_args(parameter.annotation)[0] if option.words else parameter.annotation
    kind = option.typed or kind
    if get_origin(kind) is Sequence:
        kind = tuple[str, ...]
    parts = {kind, *get_args(kind)} - {type(None)}
    hyphen = name in WITH_HYPHEN or bool(parts & {int, float})
    if hyphen or name in NAMES or option.name:
        typed_name = option.name or NAMES.get(name)
        return Annotated[kind, Parameter(name=typed_name, allow_leading_hyphen=hyphen)]
    return kind
