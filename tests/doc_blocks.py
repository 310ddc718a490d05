"""The blocks of code in the documentation, run in the order in which a reader meets them."""

import contextlib
import io
import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FENCE = re.compile(r"^```(?P<head>[^\n`]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
COMMENT = re.compile(r"<!--\s*(?P<word>given|acceptance|status|fragment)\b:?\s*(?P<text>.*?)-->", re.DOTALL)
TITLE = re.compile(r'title="(?P<title>[^"]+)"')
SECONDS = 600.0


@dataclass(frozen=True)
class Block:
    """A block of a page.

    Attributes
    ----------
    language : str
        "given" for commands in a comment: the reader's assumed preparation
    title : str
        name of the file in the block, or empty
    text : str
        content
    line : int
        line of the page, from 1
    acceptance : bool
        True if it is too slow for every run
    status : int
        exit status of its last command
    fragment : bool
        True for a part of a file, which only has to be well-formed
    follows : bool
        True if it is directly below the previous block
    """

    language: str
    title: str
    text: str
    line: int
    acceptance: bool = False
    status: int = 0
    fragment: bool = False
    follows: bool = False


def blocks_of(page: Path) -> list[Block]:
    """Return the blocks of a page and the comments that prepare for them, in order."""
    text = page.read_text(encoding="utf-8")
    fences = list(FENCE.finditer(text))
    inside = [(match.start(), match.end()) for match in fences]
    result = [*fences, *(m for m in COMMENT.finditer(text) if not any(a <= m.start() < b for a, b in inside))]
    marks: dict[str, str] = {}
    blocks = []
    end = 0
    for match in sorted(result, key=lambda match: match.start()):
        line = text.count("\n", 0, match.start()) + 1
        if match.re is COMMENT:
            if match["word"] == "given":
                blocks.append(Block("given", "", match["text"], line, "acceptance" in marks))
            else:
                marks[match["word"]] = match["text"].strip()
            continue
        language, _, rest = match["head"].strip().partition(" ")
        title = TITLE.search(rest)
        blocks.append(
            Block(
                language,
                title["title"] if title else "",
                match["text"],
                line,
                "acceptance" in marks,
                int(marks.get("status") or 0),
                "fragment" in marks,
                not text[end : match.start()].strip(),
            )
        )
        marks = {}
        end = match.end()
    return blocks


class Reader:
    """A reader who follows a page in a folder of their own.

    Parameters
    ----------
    page : Path
        the page
    folder : Path
        empty folder
    records : Path
        folder of records with which several pages begin, as `$RECORDS`
    programs : Path
        first folder of the path
    long : bool
        True to run slow blocks too
    """

    def __init__(self, page: Path, folder: Path, records: Path, programs: Path, *, long: bool):
        self._page, self._folder, self._long = page, folder, long
        self._names: dict[str, object] = {"__name__": "__main__"}
        self._printed: str | None = None
        home = folder.parent / "home"
        home.mkdir(exist_ok=True)
        path = os.pathsep.join([str(programs), str(Path(sys.executable).parent), os.environ.get("PATH", "")])
        scenarios = str(ROOT / "scenarios")
        self._environment = {
            **os.environ,
            "SCENARIOS": scenarios,
            "RECORDS": str(records),
            "PATH": path,
            "HOME": str(home),
            "COLUMNS": "100",
            "PYTHONWARNINGS": "error",
        }

    def read(self) -> int:
        """Run the page; return the number of blocks that were run.

        Raises
        ------
        AssertionError
            with page and line of the first block that fails
        """
        run = 0
        for block in blocks_of(self._page):
            if block.acceptance and not self._long:
                self._printed = None
                continue
            where = f"{self._page.name}:{block.line}"
            action = getattr(self, f"_{block.language}", None)
            assert action is not None, f"{where}: no way to run a block of '{block.language}'"
            action(block, where)
            run += 1
        return run

    def _given(self, block: Block, where: str) -> None:
        self._sh(block, where)
        self._printed = None

    def _sh(self, block: Block, where: str) -> None:
        if block.fragment:
            self._known_options(block, where)
            return
        process = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", block.text],
            cwd=self._folder,
            env=self._environment,
            capture_output=True,
            text=True,
            timeout=SECONDS,
            stdin=subprocess.DEVNULL,
            check=False,
        )
        assert process.returncode == block.status, (
            f"{where}: exit status {process.returncode}: {process.stderr.strip()}"
        )
        self._printed = process.stdout if block.status == 0 else process.stderr

    def _known_options(self, block: Block, where: str) -> None:
        """Check that the command and its options exist, for commands that are too slow even for a long test."""
        for line in block.text.replace("\\\n", " ").splitlines():
            words = line.split()
            if words[:1] != ["trihedron"]:
                continue
            content = subprocess.run(
                [*words[:2], "--help"], env=self._environment, capture_output=True, text=True, check=True
            )
            missing = [word for word in words if word.startswith("--") and word not in content.stdout]
            assert missing == [], f"{where}: no such options: {missing}"
        self._printed = None

    def _python(self, block: Block, where: str) -> None:
        code = compile(block.text, where, "exec")
        if block.title:
            self._file(block)
            return
        content = io.StringIO()
        before = Path.cwd()
        os.chdir(self._folder)
        try:
            with contextlib.redirect_stdout(content):
                exec(code, self._names)
        except Exception as error:
            raise AssertionError(f"{where}: {type(error).__name__}: {error}") from error
        finally:
            os.chdir(before)
        self._printed = content.getvalue()

    def _text(self, block: Block, where: str) -> None:
        """Compare with the output of the block directly above, or a file if it has a title; elsewhere it is text."""
        if block.title:
            self._file(block)
            return
        if block.follows and self._printed is not None:
            assert matches(block.text, self._printed), f"{where}: printed is\n{self._printed}"
        self._printed = None

    def _toml(self, block: Block, where: str) -> None:
        tomllib.loads(block.text)
        self._file(block)

    def _json(self, block: Block, where: str) -> None:
        json.loads(block.text)
        self._file(block)

    def _csv(self, block: Block, where: str) -> None:
        widths = {line.count(",") for line in block.text.splitlines()}
        assert len(widths) == 1, f"{where}: rows of different widths"
        self._file(block)

    def _file(self, block: Block) -> None:
        self._printed = None
        if block.title:
            path = self._folder / block.title
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(block.text, encoding="utf-8")


def matches(wanted: str, printed: str) -> bool:
    """Return True if printed lines match a page's; a line of three dots matches any lines."""
    pattern = "".join(
        r"(?:[^\n]*\n)*?" if line.strip() == "..." else re.escape(line.rstrip()) + r"[ ]*\n"
        for line in wanted.splitlines()
    )
    return re.fullmatch(pattern, printed if printed.endswith("\n") else printed + "\n") is not None
