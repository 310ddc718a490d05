"""Ten thousand inputs that are almost right, over all commands: each is refused in one line, or done.

TRIHEDRON_FUZZ says how many, TRIHEDRON_FUZZ_FROM from which seed; a seed decides command, file and change. A failure
names its seed: `TRIHEDRON_FUZZ_FROM=seed TRIHEDRON_FUZZ=1` is that input alone. FOUND keeps those that found something.
"""

import os
import random
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import polars as pl
import pytest

from command_table import make_inputs
from forked_commands import Done, ForkedCommands
from fuzzed_inputs import changed, option
from laboratory_workbooks import xls, xlsx
from trihedron.tools import cli

pytestmark = [pytest.mark.acceptance, pytest.mark.skipif(os.name == "nt", reason="processes are forked")]
INPUTS = int(os.environ.get("TRIHEDRON_FUZZ", "10000"))
FROM = int(os.environ.get("TRIHEDRON_FUZZ_FROM", "0"))
FOUND: tuple[int, ...] = ()
"""Seeds that found a fault: they are tried first."""
MOST_SECONDS, MOST_BYTES = 60.0, 3 << 30
"""Of the processor; by the clock so many times as many, where other programs run beside it."""
BUSY = 5.0
BATCH = 500
RECORD = "clean.csv measured.csv"
FINISHED = [f"finished/{name}" for name in ("campaign.json", "SHA256SUMS", "runs/part-00000.parquet")]
TRIED = {
    "simulate {} --out out": (4, "run.toml bench.toml bench-positions.csv system.ssp"),
    "calibrate {} --noise-bound 1e-5 --json out.json": (12, RECORD),
    "calibrate {} --noise-bound 1e-5 --json out.json --report out.html --ssv out.ssv": (2, RECORD),
    "diagnose {} --noise-bound 1e-5 --json out.json": (6, RECORD),
    "diagnose {} --noise-bound 1e-5 --hypothesis f1+=c*f2 --report out.html": (1, RECORD),
    "diagnose {} --json out.json": (2, "strapdown.csv"),
    "apply calibration.json {} --out out.csv": (6, RECORD),
    "apply {} clean.csv --json out.json": (8, "calibration.json"),
    "inspect {} --json out.json --allan out.svg": (7, "strapdown.csv"),
    "attitude {} --out out": (5, "strapdown.csv"),
    "fmpy-input {} --out out.csv": (7, "strapdown.csv raw.csv"),
    "hidden out.csv --seed 3": (2, ""),
    "export AccelerometerBlock --out out --effect quadratic": (1, ""),
    "export-ssp {} --out out.ssp --flavour python": (3, "run.toml bench.toml"),
    "plan --target X4 --grid 15 --bounds 3e-3 1e-2 --json out.json": (2, ""),
    "plan --positions 6 --starts 1 --cuts 0 --out out": (1, ""),
    "plan --check {} --noise-bound 1e-5 --json out.json": (3, "angles.csv"),
    "plan --target X4 --grid 30 --mounting {}": (3, "mounting.toml"),
    "import {} --out out.csv --set decimal=,": (9, "foreign.csv"),
    "import {} --out out.csv --mapping {}": (3, "clean.csv mapping.toml"),
    "import {} --out out.csv": (5, "book.xlsx book.xls clean.csv strapdown.csv"),
    "check {} --json out.json": (
        14,
        "run.toml campaign.toml clean.csv strapdown.csv calibration.json diagnosis.json block.fmu system.ssp",
    ),
    "new record out.csv --positions 12": (1, ""),
    "campaign {} --jobs 1 --out out": (1, "campaign.toml"),
    "campaign-report finished --report out.html": (
        3,
        f"{' '.join(FINISHED)}",
    ),
}
"""Commands, how often each is tried, and the files of it that are changed."""


@dataclass(frozen=True)
class Input:
    """A command in a folder where one of its files may be another one than the right one."""

    arguments: list[str]
    name: str = ""
    content: bytes = b""


def drawn(seed: int, inputs: Path) -> Input:
    """The input of a seed."""
    rng = random.Random(seed)
    line = rng.choices([*TRIED], [weight for weight, _ in TRIED.values()])[0]
    files = TRIED[line][1].split()
    words = line.split()
    name, content = "", b""
    if files and rng.random() < 0.85:
        name = rng.choice(files)
        content = changed(name, (inputs / name).read_bytes(), rng)
    else:
        places = [k for k, word in enumerate(words) if word.startswith("--") and words[k + 1] != "{}"]
        for k in rng.sample(places, min(len(places), rng.choice([1, 1, 2]))):
            words[k + 1] = option(words[k], words[k + 1], rng)
    # The scenario that reads the positions is named, the file that is changed is beside it.
    named = {"bench-positions.csv": "bench.toml"}.get(name, name or "".join(files[:1]))
    given = iter(files if words.count("{}") > 1 else [named])
    return Input([next(given) if word == "{}" else word for word in words], name, content)


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All files that are right."""
    folder = tmp_path_factory.mktemp("inputs")
    make_inputs(folder)
    here = Path.cwd()
    os.chdir(folder)
    try:
        for line in (
            "diagnose measured.csv --noise-bound 1e-5 --json diagnosis.json",
            "export AccelerometerBlock --out made",
            "export-ssp run.toml --out system.ssp --flavour python",
            "simulate bench.toml --out raw",
            "import foreign.csv --out imported.csv --set decimal=,",
        ):
            assert cli.main([*line.split(), "--quiet"]) == 0, line
    finally:
        os.chdir(here)
    shutil.copy(folder / "made" / "AccelerometerBlock.fmu", folder / "block.fmu")
    shutil.copy(folder / "imported.import.toml", folder / "mapping.toml")
    pl.read_parquet(folder / "raw" / "run.parquet").head(3000).write_csv(folder / "raw.csv")
    rows = [line.split(",") for line in (folder / "clean.csv").read_text().splitlines() if not line.startswith("#")]
    cells = [rows[0], *([float(cell) for cell in row] for row in rows[1:])]
    (folder / "book.xlsx").write_bytes(xlsx({"Sheet1": cells}))
    (folder / "book.xls").write_bytes(xls({"Sheet1": cells}))
    matrix = "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"
    (folder / "mounting.toml").write_text(f"[turned]\nmatrix = {matrix}\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkedCommands]:
    folder = tmp_path_factory.mktemp("commands")
    (folder / "temporary").mkdir()
    with ForkedCommands({**os.environ, "TMPDIR": str(folder / "temporary")}, folder / "said") as started:
        yield started


def done_with(given: Input, inputs: Path, folder: Path, commands: ForkedCommands) -> Done:
    """What comes of an input; the other files are links to the right ones."""
    folder.mkdir()
    for path in inputs.rglob("*"):
        place = folder / path.relative_to(inputs)
        if path.is_dir():
            place.mkdir()
        elif place.relative_to(folder).as_posix() != given.name:
            place.symlink_to(path)
    if given.name:
        (folder / given.name).write_bytes(given.content)
    try:
        return commands.run(given.arguments, folder, seconds=BUSY * MOST_SECONDS)
    finally:
        shutil.rmtree(folder)


def fault(done: Done) -> str:
    """What is wrong with how a command has ended; nothing where it is refused in one line, or done."""
    if done.cpu_seconds > MOST_SECONDS or done.seconds > BUSY * MOST_SECONDS:
        return f"took more than {MOST_SECONDS:g} s"
    if done.peak_bytes > MOST_BYTES:
        return f"took {done.peak_bytes / 2**30:.1f} GiB"
    if "Traceback" in done.err or "panicked" in done.err:
        return f"traceback: {done.err[-600:]}"
    if done.status not in (0, 2):
        return f"exit status {done.status}: {done.err[-300:]}"
    if done.status == 2 and sum(line.startswith("trihedron: ") for line in done.err.splitlines()) != 1:
        return f"refused without a line of its own: {done.err[-300:]}"
    if "Warning" in done.err:
        return f"warned: {done.err[-300:]}"
    return ""


SEEDS = [*FOUND, *range(FROM, FROM + INPUTS)]
BATCHES = [SEEDS[k : k + BATCH] for k in range(0, len(SEEDS), BATCH)]


@pytest.mark.parametrize("seeds", BATCHES, ids=lambda seeds: f"{seeds[0]}-{seeds[-1]}")
def test_inputs_that_are_almost_right(seeds: list[int], inputs: Path, tmp_path: Path, commands: ForkedCommands) -> None:
    faults = []
    counts: dict[str, list[float]] = {}
    for seed in seeds:
        given = drawn(seed, inputs)
        done = done_with(given, inputs, tmp_path / "here", commands)
        title = given.arguments[0]
        kept = counts.setdefault(title, [0, 0, 0.0, 0.0, 0.0])
        kept[0 if done.status == 2 else 1] += 1
        kept[2] += done.cpu_seconds
        kept[3] = max(kept[3], done.cpu_seconds)
        kept[4] = max(kept[4], done.peak_bytes / 2**20)
        if wrong := fault(done):
            faults.append(f"seed {seed}, {given.name or 'options'}, {' '.join(given.arguments)[:200]}: {wrong}")
            print(faults[-1], file=sys.stderr)
    print(f"\n{'command':18}refused   done  mean [s]  most [s]  most [MiB]", file=sys.stderr)
    for title, (refused, right, seconds, most, peak) in sorted(counts.items()):
        mean = seconds / (refused + right)
        print(f"{title:18}{refused:7g}{right:7g}{mean:10.2f}{most:10.2f}{peak:12.0f}", file=sys.stderr)
    assert not faults, "\n".join(faults)
