"""Ten thousand nearly correct inputs, over all commands: each is refused in one line, or done.

TRIHEDRON_FUZZ sets the number, TRIHEDRON_FUZZ_FROM the first seed; a seed decides command, file and change. A failure
names its seed: `TRIHEDRON_FUZZ_FROM=seed TRIHEDRON_FUZZ=1` runs that input alone. FOUND keeps seeds that found a fault.
"""

import gzip
import os
import random
import shutil
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import polars as pl
import pytest

from command_table import files, make_inputs
from forked_commands import Done, ForkedCommands
from fuzzed_inputs import changed, option
from generator.positions import write_hidden_record
from laboratory_workbooks import ods, xls, xlsb, xlsx
from trihedron.models.effects import EffectPlace
from trihedron.tools import cli

pytestmark = [pytest.mark.acceptance, pytest.mark.skipif(os.name == "nt", reason="processes are forked")]
INPUTS = int(os.environ.get("TRIHEDRON_FUZZ", "10000"))
FROM = int(os.environ.get("TRIHEDRON_FUZZ_FROM", "0"))
FOUND = (2756, 3887, 3900, 6789, 8568, 21469, 23453)
"""Seeds that found a fault: they are tried first."""
MOST_SECONDS, MOST_BYTES = 60, 3 << 30
"""Limits of processor time [s] and memory [bytes]."""
STANDSTILL = 3600.0
"""Wall-clock limit of a command that waits [s]: other programs may run beside it."""
BATCH = 500
RECORD = "clean.csv measured.csv"
FINISHED = "finished/campaign.json finished/runs/part-00000.parquet"
RAW = "raw.csv"
UNIT = "unit/first.json"
OPTIONS = "--gravity 9.80665 --baseline symmetric --bounds 3e-3 1e-2 --channels 1,2,3"
TRIED = {
    "simulate {} --out out": (60, "run.toml bench.toml bench-positions.csv"),
    "simulate {} --step 0.1 --coupling jacobi --out out": (20, "system.ssp"),
    "simulate named.toml --out out": (15, "block.fmu named.toml"),
    "calibrate {} --noise-bound 1e-5 --json out.json": (120, RECORD),
    "calibrate {} --noise-bound 1e-5 --json out.json --report out.html --ssv out.ssv": (10, RECORD),
    f"calibrate {{}} --noise-bound 1e-5 {OPTIONS} --target X4-X5 --prior X16=1e-3 --json -": (30, "clean.csv"),
    "calibrate {} --json out.json": (20, RAW),
    "diagnose {} --noise-bound 1e-5 --json out.json": (40, RECORD),
    "diagnose {} --noise-bound 1e-5 --hypothesis f1+=c*f2 --report out.html": (8, RECORD),
    f"diagnose {{}} --noise-bound 1e-5 {OPTIONS} --json out.json --export out": (5, "measured.csv"),
    "diagnose {} --json out.json": (20, "strapdown.csv raw.csv"),
    "diagnose {} second.csv --noise-bound 1e-5 --json out.json": (14, RECORD),
    "diagnose clean.csv {} --noise-bound 1e-5 --shared bias-1 --own X16 --report out.html": (6, "second.csv"),
    "apply calibration.json {} --out out.csv": (50, f"{RECORD} strapdown.csv raw.csv"),
    "apply {} clean.csv --noise-bound 1e-5 --latitude-deg 55.75 --json out.json": (80, "calibration.json"),
    "inspect {} --json out.json --allan out.svg": (60, "strapdown.csv"),
    "inspect {} --gravity 9.8 --channels 1,2,3 --channels w=deg": (10, "strapdown.csv"),
    "attitude {} --out out": (40, "strapdown.csv"),
    "attitude {} --bridge-gaps 3 --rate-divisor 2 --rates averaged --json -": (20, "strapdown.csv"),
    "attitude {} --compare --algorithm adaptive-degree --json out.json": (5, "strapdown.csv"),
    "fmpy-input {} --out out.csv": (50, "strapdown.csv raw.csv"),
    "fmpy-input {} --bridge-gaps 2 --rates averaged --out out.csv": (10, "strapdown.csv"),
    "hidden out.csv --seed 3": (20, ""),
    "hidden out.csv --seed 3 --effect quadratic --baseline symmetric --answer out.json": (10, ""),
    "hidden out.csv --strapdown --seed 7": (2, ""),
    "hidden --cases 1 --mode clean --positions 12 14 --size 1 2 --noise edge --out out": (3, ""),
    "export AccelerometerBlock --out out --effect quadratic --fmi 2 --flavour python": (20, ""),
    "export-ssp {} --out out.ssp --flavour python --ssp 1.0 --fmi 2": (30, "run.toml bench.toml"),
    "plan target X4 --grid 30 --bounds 3e-3 1e-2 --json out.json": (15, ""),
    "plan target X4 --grid 30 --convention A2 --admissible tables --picture out.svg": (10, ""),
    "plan positions 6 --starts 1 --cuts 0 --dwell 20 --order random --repeat 1 --out out": (5, ""),
    "plan positions --curve 5 6 --starts 1 --cuts 0 --criterion mean --seed 1 --reserve 0.1": (3, ""),
    "plan check {} --noise-bound 1e-5 --json out.json": (12, "angles.csv"),
    "plan target X4 --grid 30 --mounting {}": (20, "mounting.toml"),
    "import {} --out out.csv --set decimal=,": (80, "foreign.csv"),
    "import {} --out out.csv --set decimal=. --set units.force=mg": (20, "clean.csv"),
    "import {} --out out.csv --mapping {}": (30, "clean.csv mapping.toml"),
    "import {} --out out.csv": (70, "book.xlsx book.xlsb book.xls book.ods foreign.csv.gz clean.csv strapdown.csv"),
    "check {} --json out.json": (
        140,
        "run.toml campaign.toml clean.csv strapdown.csv calibration.json diagnosis.json block.fmu system.ssp "
        "mounting.toml raw.csv programme.csv plan.json",
    ),
    "new record out.csv --positions 12": (10, ""),
    "new scenario out.toml --positions 12": (5, ""),
    "campaign {} --jobs 1 --out out": (8, "campaign.toml"),
    "campaign {} --jobs 1 --engine local --resume --out finished": (8, f"campaign.toml {FINISHED}"),
    "campaign-report finished --report out.html": (20, FINISHED),
    "campaign-report finished --against other --gate --json out.json": (10, FINISHED),
    "completion bash --json out.json": (4, ""),
    "reproduce calibration --json out.json": (2, ""),
    "demo --no-show --seed 2026 --out out": (1, ""),
    "doctor --json out.json": (2, ""),
}
"""Commands, the number of their trials, and their files that are changed."""
SINCE = {
    "export-notebook {} --noise-bound 1e-5 --out out.ipynb --json out.json": (10, "clean.csv strapdown.csv"),
    "instrument add out {} --date 2026-11-23 --json out.json": (15, "calibration.json diagnosis.json"),
    "apply {} measured.csv --out out.csv --json out.json": (30, "diagnosis.json"),
    "calibrate {} second.csv --noise-bound 1e-5 --json out.json --report out.html": (10, RECORD),
    "simulate {} --stop 0.5 --out out --plot out.html": (10, "block.fmu"),
    "compare {} second.csv --within 1e-6 --report out.html --json out.json": (20, "clean.csv raw.csv strapdown.csv"),
    "plot {} out.html": (10, "clean.csv strapdown.csv"),
    "measure angles-to-set.csv --from {} --out out.csv --noise-bound 1e-5 --patience 0 --json out.json": (
        12,
        "growing.csv",
    ),
    "measure {} --from growing.csv --out out.csv --noise-bound 1e-5 --patience 0": (8, "angles-to-set.csv"),
    "calibrate {} --latitude-deg 55.75 --azimuth-deg 20 --json out.json --report out.html": (8, "whole.csv"),
    "diagnose {} --noise-bound 1e-5 --latitude-deg 55.75 --azimuth-deg 20 --json out.json": (5, "whole.csv"),
    "instrument trend unit --json out.json --report out.html": (6, UNIT),
    "instrument show unit --out out.json": (4, UNIT),
}
"""The same for later commands, tried by part of the seeds: a seed of FOUND keeps its trials."""
PART_SINCE = 0.12
WORDS = {
    "record": ("scenario", "raw-record", "strapdown-record", "mounting", "recrd"),
    "scenario": ("record", "raw-record", "strapdown-record", "mounting", "scenari"),
    "bash": ("zsh", "fish", "sh"),
    "calibration": ("calibratio", "calibration calibration", "--help"),
    "AccelerometerBlock": ("AttitudeComputer", "GyroBlock", "Accelerometerblock", "*", "A" * 5000, "TurntableMotion"),
    "quadratic": ("quadratic accelerometer-3", "bias", "scale-drift", "quadratic accelerometer-4", "quadratic " * 50),
    "1,2,3": ("2,1,-3", "w=2,1,3", "alpha=-1", "angles=rad", "1,1,3", "1,2", "0,0,0", "f=mg", "3,2,1,0", "w="),
    "X4-X5": ("X4+X5", "X99", "X4-", "2*X4", "X4-X4", "-X4", "X4-X5-X6-X7", "X"),
    "X16=1e-3": ("bounds", "X16=0", "X16=-1", "X16=nan", "X99=1", "X16=1e400", "X1=1e-9", "X16"),
}
"""Replacements for a word that is not the number of an option."""


NAMED = """schema = "trihedron.scenario/1"
[run]
stop_s = 1.0
step_s = 0.1
[fmus.block]
fmu = "block.fmu"
[[stimuli]]
to = "block.specific_force"
constant = [0.0, 0.0, 9.8]
"""
"""A scenario that runs an FMU from a file."""


@dataclass(frozen=True)
class Input:
    """A command in a folder in which one of its files may be replaced by another."""

    arguments: list[str]
    name: str = ""
    content: bytes = b""


def drawn(seed: int, inputs: Path) -> Input:
    """Return the input of a seed."""
    rng = random.Random(seed)
    candidates, draw = TRIED, rng
    if seed not in FOUND and (later := random.Random(-1 - seed)).random() < PART_SINCE:
        candidates, draw = SINCE, later
    line = draw.choices([*candidates], [weight for weight, _ in candidates.values()])[0]
    names = candidates[line][1].split()
    words = line.split()
    name, content = "", b""
    if names and rng.random() < 0.85:
        name = rng.choice(names)
        content = changed(name, (inputs / name).read_bytes(), rng)
    if not name or rng.random() < 0.1:
        places = [k for k, word in enumerate(words) if word in WORDS or _is_value(words, k)]
        for k in rng.sample(places, min(len(places), rng.choice([1, 1, 2]))):
            if words[k] in WORDS and rng.random() < 0.7:
                words[k] = rng.choice(WORDS[words[k]])
            else:
                words[k] = option(words[k - 1], words[k], rng)
    # A file that another one names is changed beside that one.
    owners = {"bench-positions.csv": "bench.toml", **dict.fromkeys(FINISHED.split(), "campaign.toml")}
    owner = owners.get(name, name or "".join(names[:1]))
    arguments = iter(names if words.count("{}") > 1 else [owner])
    return Input([next(arguments) if word == "{}" else word for word in words], name, content)


def _is_value(words: list[str], k: int) -> bool:
    """Return True if a word is the value of an option, or one of its values."""
    return not words[k].startswith("--") and words[k] != "{}" and any(w.startswith("--") for w in words[1:k])


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write all correct files."""
    folder = tmp_path_factory.mktemp("inputs")
    make_inputs(folder)
    before = Path.cwd()
    os.chdir(folder)
    try:
        for line in (
            "diagnose measured.csv --noise-bound 1e-5 --json diagnosis.json",
            "export AccelerometerBlock --out made",
            "export-ssp run.toml --out system.ssp --flavour python",
            "simulate bench.toml --out raw",
            "import foreign.csv --out imported.csv --set decimal=,",
            "hidden whole.csv --bench --clean --seed 7",
            "plan target X4 --grid 30 --json plan.json",
            "plan positions 6 --starts 1 --cuts 0 --out planned",
        ):
            assert cli.main([*line.split(), "--quiet"]) == 0, line
    finally:
        os.chdir(before)
    shutil.copy(folder / "made" / "AccelerometerBlock.fmu", folder / "block.fmu")
    shutil.copy(folder / "imported.import.toml", folder / "mapping.toml")
    shutil.copy(folder / "planned" / "programme.csv", folder / "programme.csv")
    shutil.copytree(folder / "finished", folder / "other")
    pl.read_parquet(folder / "raw" / "run.parquet").head(3000).write_csv(folder / "raw.csv")
    for name in ("made", "planned", "raw"):
        shutil.rmtree(folder / name)
    place = EffectPlace("cross-product", "accelerometer-3", axes=(1, 2))
    write_hidden_record(folder / "second.csv", 6, place, (6e-4,))
    clean = (folder / "clean.csv").read_text(encoding="utf-8")
    rows = [line.split(",") for line in clean.splitlines() if not line.startswith("#")]
    cells = [rows[0], *([float(cell) for cell in row] for row in rows[1:])]
    for name, make in {"xlsx": xlsx, "xlsb": xlsb, "xls": xls, "ods": ods}.items():
        (folder / f"book.{name}").write_bytes(make({"Sheet1": cells}))
    (folder / "foreign.csv.gz").write_bytes(gzip.compress((folder / "foreign.csv").read_bytes(), mtime=0))
    next((folder / "unit").glob("2026-11-02*")).rename(folder / UNIT)
    matrix = "[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]"
    (folder / "mounting.toml").write_text(f"[turned]\nmatrix = {matrix}\n", encoding="utf-8")
    (folder / "named.toml").write_text(NAMED, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkedCommands]:
    folder = tmp_path_factory.mktemp("commands")
    (folder / "temporary").mkdir()
    with ForkedCommands({**os.environ, "TMPDIR": str(folder / "temporary")}, folder / "said") as started:
        yield started


def done_with(case: Input, inputs: Path, folder: Path, commands: ForkedCommands) -> Done:
    """Return the outcome of an input; the other files are links to the correct ones."""
    folder.mkdir()
    for path in inputs.rglob("*"):
        place = folder / path.relative_to(inputs)
        if path.is_dir():
            place.mkdir()
        elif path.is_relative_to(inputs / "finished"):
            # The campaign continues in this folder: its outputs go into it.
            shutil.copy(path, place)
        elif place.relative_to(folder).as_posix() != case.name:
            place.symlink_to(path)
    if case.name:
        (folder / case.name).write_bytes(case.content)
    try:
        return commands.run(case.arguments, folder, seconds=STANDSTILL, cpu_seconds=MOST_SECONDS)
    finally:
        shutil.rmtree(folder)


def fault(outcome: Done, gated: bool = False) -> str:
    """Return the fault in the end of a command; empty if it is refused in one line, or done.

    `gated` commands were asked to end in 3 if two differ.
    """
    if outcome.cpu_seconds > MOST_SECONDS or outcome.seconds > STANDSTILL:
        return f"took {outcome.cpu_seconds:.0f} s of the processor, {outcome.seconds:.0f} s by the clock"
    if outcome.peak_bytes > MOST_BYTES:
        return f"took {outcome.peak_bytes / 2**30:.1f} GiB"
    if "Traceback" in outcome.err or "panicked" in outcome.err:
        return f"traceback: {outcome.err[-600:]}"
    if outcome.status not in (0, 2, *((3,) if gated else ())):
        return f"exit status {outcome.status}: {outcome.err[-300:]}"
    if outcome.status == 2 and sum(line.startswith("trihedron: ") for line in outcome.err.splitlines()) != 1:
        return f"refused without a line of its own: {outcome.err[-300:]}"
    if "Warning" in outcome.err:
        return f"warned: {outcome.err[-300:]}"
    return ""


SEEDS = [*FOUND, *range(FROM, FROM + INPUTS)]
BATCHES = [SEEDS[k : k + BATCH] for k in range(0, len(SEEDS), BATCH)]


class Counts:
    """Outcomes of the inputs, by command."""

    def __init__(self) -> None:
        self._done: dict[str, list[Done]] = {}

    def add(self, title: str, outcome: Done) -> None:
        self._done.setdefault(title, []).append(replace(outcome, out="", err=""))

    def show(self) -> None:
        print(f"\n{'command':18}refused   done  mean [s]  most [s]  most [MiB]", file=sys.stderr)
        for title, all_done in [*sorted(self._done.items()), ("all", [*chain(*self._done.values())])]:
            refused = sum(process.status == 2 for process in all_done)
            seconds = [process.cpu_seconds for process in all_done]
            numbers = f"{sum(seconds) / len(seconds):10.2f}{max(seconds):10.2f}"
            peak = max(process.peak_bytes for process in all_done) / 2**20
            print(f"{title:18}{refused:7}{len(all_done) - refused:7}{numbers}{peak:12.0f}", file=sys.stderr)


@pytest.fixture(scope="session")
def counts() -> Iterator[Counts]:
    retained = Counts()
    yield retained
    retained.show()


@pytest.mark.parametrize("seeds", BATCHES, ids=lambda seeds: f"{seeds[0]}-{seeds[-1]}")
def test_inputs_that_are_almost_right(
    seeds: list[int], inputs: Path, tmp_path: Path, commands: ForkedCommands, counts: Counts
) -> None:
    faults = []
    before = files(inputs)
    for seed in seeds:
        arguments = drawn(seed, inputs)
        process = done_with(arguments, inputs, tmp_path / "here", commands)
        counts.add(arguments.arguments[0], process)
        if wrong := fault(process, not {"--gate", "--within"}.isdisjoint(arguments.arguments)):
            faults.append(f"seed {seed}, {arguments.name or 'options'}, {' '.join(arguments.arguments)[:200]}: {wrong}")
            print(faults[-1], file=sys.stderr, flush=True)
    assert files(inputs) == before
    assert not faults, "\n".join(faults)
