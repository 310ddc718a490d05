"""The help of a command in 80 columns: usage, examples, a sentence, then arguments and options in groups."""

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cyclopts.help import HelpEntry, HelpPanel
    from rich.console import Console

WIDTH = 80
"""Largest width of a line [columns]."""
NAMES = 24
"""Columns for names; a longer name has a line of its own."""
PARAMETERS, OPTIONS = "Parameters", "Options"
"""Title of the panel of options, and the heading of those without a group."""
GROUPS = {
    "Noise": ("--noise", "--noise-bound", "--noise-sd", "--reference-bound"),
    "Reading the file": ("--channels", "--stamps", "--trust", "--without", "--rates", "--bridge-gaps", "--mapping"),
    "Model": (
        *("--gravity", "--mounting", "--mountings", "--convention", "--baseline", "--bounds", "--admissible"),
        *("--target", "--prior", "--with", "--effects-from", "--hypothesis", "--extend"),
    ),
    "Bench with gyros": ("--latitude-deg", "--azimuth-deg", "--gyro-noise", "--encoder-bound"),
    "Without a table": ("--rest-scatter", "--rests", "--faces", "--turns"),
    "Several records": ("--shared", "--own"),
    "Table": ("--rate-dps", "--acceleration-dps2", "--keep-out", "--reserve", "--resolution", "--order", "--repeat"),
    "Search": ("--starts", "--cuts", "--exchanges"),
    "Results": (
        *("--out", "--json", "--report", "--sheet", "--about", "--plot", "--ssv", "--strapdown", "--export"),
        *("--allan", "--picture", "--answer"),
    ),
}
"""Headings of options; all others are below `OPTIONS`, which comes first."""


class HelpPage:
    """A formatter of cyclopts, which calls its methods in the order of the page."""

    def render_usage(self, console: "Console", options: Any, usage: Any) -> None:
        """Print the line of usage."""
        _print(console, _wrapped(f"Usage: {usage}".strip(), "", "  "))

    def render_description(self, console: "Console", options: Any, description: Any) -> None:
        """Print the examples of a description, then its sentences."""
        paragraphs = _plain(description).split("\n\n")
        examples = [text for text in paragraphs if text.startswith("Example: ")]
        lines = ["", "Examples:" if len(examples) > 1 else "Example:"]
        lines += [f"  {' '.join(text.split()[1:])}" for text in examples]
        for text in paragraphs:
            if text and text not in examples:
                lines += ["", *_wrapped(" ".join(text.split()), "", "")]
        _print(console, lines)

    def __call__(self, console: "Console", options: Any, panel: "HelpPanel") -> None:
        """Print a panel, options below the headings of their groups."""
        groups: dict[str, list[HelpEntry]] = {title: [] for title in (OPTIONS, *GROUPS)}
        for entry in panel.entries:
            title = heading_of(entry.positive_names) if panel.title == PARAMETERS else str(panel.title)
            groups.setdefault(title, []).append(entry)
        for title, entries in groups.items():
            if entries:
                lines = ["", f"{title}:"]
                for entry in entries:
                    lines += _entry_lines(entry)
                _print(console, lines)


def heading_of(names: Sequence[str]) -> str:
    """Return the heading of an option with these names."""
    for title, members in GROUPS.items():
        if not set(names).isdisjoint(members):
            return title
    return OPTIONS


def _entry_lines(entry: "HelpEntry") -> list[str]:
    """Return the name of a command or option, and its words beside it."""
    name = "  " + " ".join(entry.display_labels_with_metavar)
    words = [" ".join(_plain(entry.description).split())]
    if entry.choices:
        words.append(f"[{' | '.join(entry.choices)}]")
    if entry.default is not None:
        words.append(f"[default: {entry.default}]")
    if entry.required:
        words.append("[required]")
    text = " ".join(words).strip()
    margin = " " * (NAMES + 2)
    if len(name) <= NAMES:
        return _wrapped(text, name.ljust(NAMES + 2), margin) or [name]
    return [name, *_wrapped(text, margin, margin)]


def _wrapped(text: str, first: str, others: str) -> list[str]:
    return textwrap.wrap(
        text, WIDTH, initial_indent=first, subsequent_indent=others, break_on_hyphens=False, break_long_words=False
    )


def _plain(words: Any) -> str:
    """Return the text of words for a terminal, without styles."""
    return str(getattr(words, "primary_renderable", words)).strip()


def _print(console: "Console", lines: Sequence[str]) -> None:
    console.print("\n".join(lines), soft_wrap=True, highlight=False, markup=False)
