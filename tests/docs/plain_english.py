"""Check the language of docs, README and `--help`: `python tests/docs/plain_english.py`; `make lint` runs it."""

import re
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONGEST = 30
"""Most words of a sentence."""
MEDIAN = 16
"""The median sentence has fewer words."""
WORDS = 30_000
"""Most words of all pages in docs together."""
ODD_TURNS = (
    r"\b(is|are) (said|told)\b",
    r"\bstands? beside\b",
    r"\b(so|as) many\b",
    r"\bwhatever the\b",
    r"\b(by how much|how far|of which|such as are|the one that|nothing else that)\b",
    r"\bwhat (is|was|are|has|have|it|its|the|they|one|a|no|does|each|people)\b",
)
"""Inverted or anonymous phrases; a noun or an actor in their place reads better."""
ODD = re.compile("|".join(ODD_TURNS), re.IGNORECASE)
END = re.compile(r"(?<=[.!?])[)*”]*\s+(?=[^a-z])|\n\s*\n")
"""Between sentences; an item of a list is a sentence."""
PART = re.compile(END.pattern + r"|(?<=[:;])\s+")
"""Between parts of a table's cell, which may be a list."""


@dataclass(frozen=True)
class Sentence:
    """A sentence with its place.

    Attributes
    ----------
    place : str
        file or command
    text : str
        its words, code as one word
    cell : bool
        True in a table
    """

    place: str
    text: str
    cell: bool = False

    @property
    def words(self) -> int:
        """Number of words."""
        return len(re.findall(r"[^\W\d_]+", self.text))


def sentences_of(text: str, place: str) -> list[Sentence]:
    """Return the sentences of a page in Markdown, without code and the targets of links."""
    text = re.sub(r"```.*?```|<!--.*?-->", "\n", text, flags=re.DOTALL)
    text = re.sub(r"^#.*$|^ {4}.*$|^\|[-|]+$", "\n", text, flags=re.MULTILINE)
    text = re.sub(r"`[^`]*`", "Code", text)
    text = re.sub(r"\]\([^)]*\)", "]", text)
    rows = re.findall(r"^\|.*\|$", text, flags=re.MULTILINE)
    prose = re.sub(r"^\|.*\|$", "\n", text, flags=re.MULTILINE)
    prose = re.sub(r"^\s*([-*]|\d+\.)\s", "\n\n", prose, flags=re.MULTILINE)
    sentences = [Sentence(place, piece) for piece in END.split(prose)]
    for row in rows:
        for cell in re.split(r"(?<!\\)\|", row):
            sentences += [Sentence(place, piece, cell=True) for piece in PART.split(cell)]
    return [sentence for sentence in sentences if sentence.words > 3]


def pages() -> Iterator[Path]:
    """Yield the README and the pages of docs."""
    yield ROOT / "README.md"
    yield from sorted((ROOT / "docs").glob("*.md"))


def help_sentences() -> list[Sentence]:
    """Return the sentences that `--help` of each command prints."""
    from site_pages import help_text
    from trihedron.tools.cli import app

    sentences = []
    for name in app:
        if name.startswith("-"):
            continue
        lines = [line for line in help_text(app, name, width=2000).splitlines() if not line.startswith("Usage")]
        # Frames and columns end a sentence.
        text = "\n\n".join(re.sub(r"[─╭╮╰╯│]+|\s{2,}|\[\w+:[^\]]*\]|\[required\]", "\n\n", line) for line in lines)
        text = re.sub(r"^Example: .*$", "", text, flags=re.MULTILINE)
        sentences += sentences_of(text, f"trihedron {name} --help")
    return sentences


def complaints(sentences: list[Sentence]) -> list[str]:
    """Return a line for each long sentence and odd turn, and for a median that is too high."""
    lines = []
    for sentence in sentences:
        shown = " ".join(sentence.text.split())
        if sentence.words > LONGEST:
            lines.append(f"{sentence.place}: {sentence.words} words, at most {LONGEST}: {shown}")
        if (turn := ODD.search(sentence.text)) and not sentence.text.rstrip().endswith("?"):
            lines.append(f"{sentence.place}: '{turn.group()}': name the actor or the thing: {shown}")
    median = statistics.median([s.words for s in sentences if not s.cell] or [0])
    if median >= MEDIAN:
        lines.append(f"the median sentence has {median:g} words, not under {MEDIAN}")
    return lines


def main() -> int:
    """Print complaints; return 1 if there are any."""
    sys.path[:0] = [str(ROOT / "docs" / "builders")]
    texts = {page: page.read_text(encoding="utf-8") for page in pages()}
    sentences = [s for page, text in texts.items() for s in sentences_of(text, str(page.relative_to(ROOT)))]
    lines = complaints([*sentences, *help_sentences()])
    words = sum(len(text.split()) for page, text in texts.items() if page.parent != ROOT)
    if words > WORDS:
        lines.append(f"docs has {words} words, at most {WORDS}: shorten a page before you add one")
    print("\n".join(lines), end="\n" * bool(lines))
    return bool(lines)


if __name__ == "__main__":
    sys.exit(main())
