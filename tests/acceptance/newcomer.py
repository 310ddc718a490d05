"""A newcomer, scripted: from an empty environment by pip, then by make, every command of README, commands and tutorial.

    python tests/acceptance/newcomer.py python3.11 python3.13 [--way pip|make] [--without WORD ...] [--in FOLDER]

It needs a package index. It prints the seconds of each step and the megabytes of each environment, and ends with status
1 if a command does. `--without` leaves out commands that begin with a word; use it for slow ones such as campaign or
reproduce.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from doc_blocks import blocks_of  # noqa: E402

NOT_COPIED = shutil.ignore_patterns(
    ".venv", ".git", "build", "dist", "site", "demo-results", "*.egg-info", "__pycache__"
)


def readme_commands() -> list[str]:
    """Commands of the README, then those of "Every command once" in the page on the command line."""
    lines = (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
    lines = [line for line in lines if line.startswith("    trihedron ")]
    once = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8").partition("## Every command once")[2]
    lines += [line for line in once.partition("## ")[0].splitlines() if line.startswith("trihedron ")]
    return [line.split("  #")[0].strip() for line in lines]


def tutorial_commands() -> list[str]:
    """Return the blocks of the tutorial that are typed into a shell."""
    return [block.text for block in blocks_of(ROOT / "docs" / "tutorial.md") if block.language == "sh"]


def megabytes(folder: Path) -> float:
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file() and not p.is_symlink()) / 1e6


class Newcomer:
    """Steps in a folder, one after another, with their times; `failed` are the failed ones."""

    def __init__(self, title: str, folder: Path) -> None:
        self.folder, self.failed = folder, list[str]()
        self.own = {**os.environ, "TRIHEDRON_CACHE": str(folder / "cache"), "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
        self.own.pop("VIRTUAL_ENV", None)
        print(f"\n{title}", flush=True)

    def step(self, command: str, where: Path) -> None:
        """Run a command of a shell as typed."""
        began = time.monotonic()
        process = subprocess.run(
            ["bash", "-ec", command], cwd=where, env=self.own, capture_output=True, text=True, check=False
        )
        text = command.strip().splitlines()[0] + (" ..." if "\n" in command.strip() else "")
        print(f"  {time.monotonic() - began:7.1f} s  status {process.returncode}  {text[:100]}", flush=True)
        if process.returncode:
            self.failed.append(text)
            print((process.stdout + process.stderr)[-800:], flush=True)

    def commands(self, checkout: Path, without: list[str]) -> None:
        """Run every command of README and command line, then the tutorial in a folder of its own."""
        shutil.copy(ROOT / "docs" / "gallery" / "consistent.csv", checkout / "measurements.csv")
        for command in readme_commands():
            if command.split()[1] not in without:
                self.step(command, checkout)
        lesson = self.folder / "lesson"
        lesson.mkdir()
        for block in tutorial_commands():
            self.step(block, lesson)


def by_pip(python: str, folder: Path, without: list[str]) -> list[str]:
    """Run `pip install <wheel>`, then `trihedron demo`."""
    new = Newcomer(f"{python}, by pip", folder)
    checkout, environment = folder / "checkout", folder / "environment"
    shutil.copytree(ROOT, checkout, ignore=NOT_COPIED)
    new.step(f"{python} -m venv {environment}", folder)
    empty = megabytes(environment)
    new.own["PATH"] = f"{environment / 'bin'}{os.pathsep}{os.environ['PATH']}"
    new.step(f"python -m pip wheel --quiet --no-deps --wheel-dir dist {checkout}", folder)
    new.step("python -m pip install --quiet dist/*.whl", folder)
    print(f"  {megabytes(environment) - empty:7.0f} MB beside {empty:.0f} of an empty environment", flush=True)
    new.step("trihedron demo --no-show", folder)
    new.commands(checkout, without)
    return new.failed


def by_make(python: str, folder: Path, without: list[str]) -> list[str]:
    """Run `make demo`, which sets up, in a checkout."""
    new = Newcomer(f"{python}, by make", folder)
    checkout = folder / "checkout"
    shutil.copytree(ROOT, checkout, ignore=NOT_COPIED)
    new.step(f"make demo PYTHON={python} < /dev/null", checkout)
    print(f"  {megabytes(checkout / '.venv'):7.0f} MB", flush=True)
    new.own["PATH"] = f"{checkout / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}"
    new.commands(checkout, without)
    return new.failed


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pythons", nargs="+")
    parser.add_argument("--way", choices=("pip", "make"))
    parser.add_argument("--without", nargs="*", default=[])
    parser.add_argument("--in", dest="folder", type=Path, default=Path(tempfile.gettempdir()))
    options = parser.parse_args()
    wrong: list[str] = []
    for python in options.pythons:
        for way in (by_pip, by_make):
            if options.way in (None, way.__name__.removeprefix("by_")):
                with tempfile.TemporaryDirectory(dir=options.folder) as temporary:
                    wrong += way(python, Path(temporary), options.without)
    print(f"\n{len(wrong)} commands did not work: {'; '.join(wrong)}" if wrong else "\nevery command works")
    sys.exit(bool(wrong))
