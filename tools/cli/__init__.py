"""The command line: commands, common options, start."""

import atexit
import gc
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

# A start makes many objects and hardly any garbage.
_collects = gc.isenabled()
gc.disable()

from cyclopts import App, Group, Parameter

from ...version import VERSION
from ..options import PLACES
from . import commands, studies
from .answer import Answer, exit_status, no_working_folder, refuse, say, too_little_memory
from .call import Call
from .completion import add_completion
from .help_page import HelpPage
from .next_step import continued, next_command
from .plan_commands import plan

for _threads in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    # Matrices are small here, and threads would only wait for each other; numpy reads this when it is imported.
    os.environ.setdefault(_threads, "1")
# They would be looked for among all that is installed.
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

__all__ = ["app", "main", "program"]
GONE_COMMANDS = {
    "choose": "attitude RECORD --compare measures them all; docs/choose-an-attitude-algorithm.md has the table"
}
"""Commands of earlier versions, and what takes their place."""
GONE_OPTIONS = {
    "plan": {
        "--minutes": "plans for minutes went: give a number of positions, or `plan imu --minutes` for the whole IMU",
        "--fewest": "it went: --accuracy by itself finds the fewest positions",
        "--lost": "plans with lost positions went: `plan check ANGLES.csv` says what the remaining ones are worth",
        "--against-unlisted": "it went: `diagnose` says from which size on an unlisted fault would have shown",
        "--goal force": "plans for the force went: --goal levelling and --goal gyrocompass stay",
    },
    "measure": {
        "--baud": "the serial port went: give the file that another program fills (--from FILE), or pipe it (--from -)"
    },
}
"""Options of commands of earlier versions, some with their value, and what to do instead."""
OF_IMU = ("imu", "--imu")
"""Words of `plan` for a whole IMU, where minutes stay."""
WITHOUT_FILES = {"--help", "-h", "--version", "-v"}
"""Options that need no working folder and little memory."""
QUIET = ("--quiet", "-q")
"""Options of every command, before or after its name."""


def shown_default(value: object) -> str | None:
    """Return a default as a person would type it, or None where the option has no default."""
    if value is None or value is False or value in ((), ""):
        return None
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


HELP = """Simulate the bench, calibrate with guaranteed bounds, find what the simulation gets wrong.

Example: trihedron demo

Example: trihedron import measured.xlsx --out record.csv

Example: trihedron calibrate record.csv --json calibration.json

Example: trihedron apply calibration.json record.csv --out corrected.csv
"""
EPILOGUE = """`trihedron help COMMAND` shows the help of a command.
Every command takes --quiet (-q): only errors, `--json -` and `--live -` print.
Exit status: 0 done, 1 fault of the program, 2 unusable input, 130 interrupted."""

app = App(
    name="trihedron",
    help=HELP,
    help_epilogue=EPILOGUE,
    help_formatter=HelpPage(),
    version=VERSION,
    version_flags=("--version", "-v"),
    default_parameter=Parameter(negative=(), negative_iterable=(), show_default=shown_default),
    help_format="plaintext",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)

GROUPS = {
    "Start": {"demo": commands.demo_command, "new": commands.new_command, "doctor": commands.doctor_command},
    "Your data": {
        "import": commands.import_command,
        "check": commands.check_command,
        "open": studies.open_command,
        "inspect": commands.inspect_command,
        "noise": commands.noise_command,
        "plan": plan,
        "measure": studies.measure_command,
        "instrument": studies.instrument,
        "plot": studies.plot_command,
    },
    "Simulate": {
        "simulate": commands.simulate_command,
        "export": commands.export_command,
        "export-ssp": commands.export_ssp_command,
        "hidden": studies.hidden_command,
    },
    "Analyse": {
        "calibrate": commands.calibrate_command,
        "diagnose": commands.diagnose_command,
        "apply": commands.apply_command,
        "export-calibration": commands.export_calibration_command,
        "attitude": commands.attitude_command,
        "compare": studies.compare_command,
        "batch": studies.batch_command,
    },
    "Advanced": {
        "campaign": studies.campaign_command,
        "campaign-report": studies.campaign_report_command,
        "export-notebook": commands.export_notebook_command,
        "fmpy-input": commands.fmpy_input_command,
        "reproduce": studies.reproduce,
    },
}
"""Commands as `trihedron --help` lists them."""
for place, (title, named_commands) in enumerate(GROUPS.items()):
    group = Group(title, sort_key=place)
    for command_name, command in named_commands.items():
        if isinstance(command, App):
            command.group = group
            app.command(command)
        else:
            app.command(command, name=command_name, group=group)
add_completion(app, "Advanced")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    words = sys.argv[1:] if arguments is None else list(arguments)
    end = words.index("--") if "--" in words else len(words)
    quiet = any(word in QUIET for word in words[:end])
    words = [word for word in words[:end] if word not in QUIET] + words[end:]
    if words and words[0] == "help":
        words = [*words[1:], "--help"]
    words = with_factor(words)
    for word in words:
        if "\0" in word:
            return refuse(f"{word!r}: holds the character NUL, which no path or word has")
    options = words[: words.index("--")] if "--" in words else words
    if words and words[0] in GONE_COMMANDS:
        return refuse(f'Unknown command "{words[0]}". {GONE_COMMANDS[words[0]]}')
    advice = gone_option(options) or place_missing(options)
    if not advice and not WITHOUT_FILES.intersection(options):
        advice = no_working_folder() or too_little_memory()
    if advice:
        return refuse(advice)
    return exit_status(lambda: say(lambda: carried_out(words), quiet=quiet))


def with_factor(words: list[str]) -> list[str]:
    """Return the words with `--realtime 1` for a `--realtime` that no number follows."""
    written = []
    for word, following in zip(words, [*words[1:], ""], strict=True):
        written.append(word)
        if word == "--realtime" and not _is_number(following):
            written.append("1")
    return written


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def carried_out(words: list[str]) -> object:
    """Carry out a command; return its answer, which ends with the command to run next."""
    command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
    outcome = command(*bound.args, **bound.kwargs)
    if not isinstance(outcome, Answer) or outcome.result is None or outcome.wanted:
        return outcome
    names, _, _ = app.parse_commands(words)
    following = next_command(Call(app, " ".join(names), bound.arguments), outcome.result)
    return replace(outcome, text=f"{outcome.text}\n\n{continued(f'Next: {following}')}")


def advice(command: str, paths: Sequence[str], options: Mapping[str, Any], result: Any) -> str:
    """Return the command that follows a result about records, for a page."""
    arguments = {"record": paths[0], "others": tuple(paths[1:]), **options}
    return next_command(Call(app, command, arguments), result)


studies.ADVICE.append(advice)
if _collects:
    gc.enable()


def place_missing(words: list[str]) -> str:
    """Return what `--live` needs where another option, or nothing, follows it; else an empty text."""
    for word, following in zip(words, [*words[1:], "--"], strict=True):
        if word == "--live" and following.startswith("--"):
            return f"--live: {PLACES}"
    return ""


def gone_option(words: list[str]) -> str:
    """Return what to do in place of an option that a command had before; empty where none is given."""
    for option, instead in GONE_OPTIONS.get(words[0] if words else "", {}).items():
        stays = option == "--minutes" and not set(words).isdisjoint(OF_IMU)
        text = " ".join(words).replace("=", " ") + " "
        if f" {option} " in text and not stays:
            return f"Unknown option: {option}: {instead}"
    return ""


def program() -> int:
    """Run the command line as a process of its own, which ends at once when the work is done."""
    # What is loaded stays, and is no garbage to look for.
    gc.freeze()
    gc.set_threshold(150_000, 10, 10)
    statuses: list[int] = []
    # Registered first it is done last. To take numpy and polars apart takes as long as to load them.
    atexit.register(_leave, statuses)
    statuses.append(main())
    return statuses[0]


def _leave(statuses: list[int]) -> None:
    """End the process after its work; if its output cannot be written, let Python report that."""
    with suppress(OSError, ValueError):
        for stream in (sys.stdout, sys.stderr):
            if stream is not None:
                stream.flush()
        for status in statuses:
            os._exit(status)
