"""SIGKILL and Ctrl-C at two hundred places of a campaign and of a simulation, with the place of each.

TRIHEDRON_KILLS sets the number.
"""

import os
import random
import re
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from campaign_runs import CALIBRATION, PARTS, assert_begun, content, written
from forked_commands import Done, ForkedCommands, Strike, with_temporary_folder

pytestmark = [pytest.mark.acceptance, pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")]
KILLS = int(os.environ.get("TRIHEDRON_KILLS", "200"))
SHARES = {
    ("local", "kill"): 0.35,
    ("local", "kill all"): 0.15,
    ("local", "ctrl-c"): 0.15,
    ("simulate", "kill"): 0.1,
    ("simulate", "ctrl-c"): 0.05,
}
"""Share of each kind of strike."""
FILES = 7
"""Files of that campaign, which are stored one after the other."""
WEIGHTS = {"write": 4, "compute": 2, "write_page": 2, "write_summary": 2}
SCENARIO = """schema = "trihedron.scenario/1"
[run]
stop_s = 24000.0
step_s = 0.01
[fmus.block]
component = "AccelerometerBlock"
[[stimuli]]
to = "block.specific_force"
constant = [0.0, 0.0, 9.8]
[record]
format = "parquet"
"""
JOURNAL = ("_begin", "add", "_spill", "_wait", "finish", "_write", "run_fmus", "simulate_table")
INTERRUPTED = r"trihedron: interrupted(; .+)?\n"


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkedCommands]:
    folder = tmp_path_factory.mktemp("commands")
    with with_temporary_folder(folder) as started:
        yield started
        assert started.run(["doctor"], folder).status == 0
    assert list((folder / "temporary").iterdir()) == []


@pytest.fixture
def fell() -> Iterator[Counter[str]]:
    """Yield the counts of the strikes by place; show them at the end."""
    counted = Counter[str]()
    yield counted
    for place, count in sorted(counted.items()):
        print(f"{place:{max(map(len, counted))}} {count:4} {'#' * count}", file=sys.stderr)
    print(f"{counted.total()} strikes", file=sys.stderr)


def number_of(kind: tuple[str, str]) -> int:
    return max(1, round(KILLS * SHARES[kind]))


class Campaign:
    """A campaign that is struck repeatedly; it restarts from the beginning after each end."""

    def __init__(self, folder: Path, commands: ForkedCommands) -> None:
        self._commands, self._folder = commands, folder
        self.path, self._begun = written(folder, CALIBRATION), 0
        process = self.run(None)
        assert process.status == 0, process.err
        self.whole, self.seconds = content(self.out), process.seconds
        # Count the calls within each function, from the beginning and with all files there.
        self.calls = self.run(Strike("", PARTS)).calls
        self.anew()
        self.calls = {**self.calls, **self.run(Strike("", PARTS)).calls}
        self.anew()

    @property
    def out(self) -> Path:
        return self._folder / f"out{self._begun}"

    def anew(self) -> None:
        assert content(self.out) == self.whole
        self._begun += 1

    def run(self, strike: Strike | None) -> Done:
        arguments = ["campaign", str(self.path), "--out", str(self.out), "--resume", "--jobs", "1"]
        return self._commands.run(arguments, self._folder, strike=strike)

    def stored(self) -> int:
        return len(list(self.out.glob("runs/part-*")))


def expected(done: Done, blow: str) -> None:
    """Check the end of the command that was struck."""
    if blow in ("kill", "kill all"):
        assert done.status == -9, done.err
        assert done.out == ""
    elif blow == "ctrl-c":
        # If no Python is called any more, the strike was too late.
        assert done.status in (0, 130), done.err
        assert done.status == 0 or re.fullmatch(INTERRUPTED, done.err), done.err
    assert "Traceback" not in done.err


def test_strikes_of_a_campaign(tmp_path: Path, commands: ForkedCommands, fell: Counter[str]) -> None:
    rng = random.Random(20)
    campaign = Campaign(tmp_path, commands)
    for kind, blow in SHARES:
        hit = tries = 0
        while kind == "local" and hit < number_of((kind, blow)):
            tries += 1
            assert tries < 20 * KILLS
            before = campaign.stored()
            within = rng.choices(PARTS, [WEIGHTS.get(place, 1) for place in PARTS])[0]
            number = rng.randint(1, max(1, campaign.calls.get(within, 1)))
            strike = Strike(within, PARTS, number, blow)
            if rng.random() < 0.4 and before < FILES:
                part = f"{campaign.out.name}/runs/part-{before:05}*"
                strike = Strike("", (), 0, blow, stored=part, delay=rng.uniform(0.0, campaign.seconds))
            process = campaign.run(strike)
            if process.struck and (process.status or not strike.stored):
                expected(process, blow)
                hit += 1
                where = "after a part" if strike.stored else strike.within or "elsewhere"
                fell[f"campaign {blow:14}{where:14}{before} -> {campaign.stored()} of {FILES} stored"] += 1
            if process.status == 0:
                campaign.anew()
            else:
                assert_begun(content(campaign.out), campaign.whole)
    assert campaign.run(None).status == 0
    campaign.anew()


def test_strikes_of_a_simulation(tmp_path: Path, commands: ForkedCommands, fell: Counter[str]) -> None:
    """Saved rows are those of the whole run; most strikes come after the first ones were saved."""
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    first = commands.run(["simulate", str(path), "--out", "whole"], tmp_path, strike=Strike("", JOURNAL))
    assert first.status == 0, first.err
    complete = content(tmp_path / "whole")
    rows = pl.read_parquet(tmp_path / "whole" / "run.parquet")
    rng, begun = random.Random(21), 0
    for kind, blow in SHARES:
        hit = 0
        while kind == "simulate" and hit < number_of((kind, blow)):
            if rng.random() < 0.75:
                strike = Strike("", (), 0, blow, stored="out/*/*.parquet", delay=rng.uniform(0.0, first.seconds))
            else:
                within = rng.choice([name for name in JOURNAL if first.calls.get(name)])
                strike = Strike(within, JOURNAL, rng.randint(1, first.calls[within]), blow)
            process = commands.run(["simulate", str(path), "--out", "out"], tmp_path, strike=strike)
            saved = sorted((tmp_path / "out").rglob("*.parquet"))
            saved = [part for part in saved if not part.name.startswith(".")]
            table = pl.concat(map(pl.read_parquet, saved)) if saved else rows.clear()
            assert table.equals(rows.head(table.height)), strike
            if process.struck and (process.status or blow == "ctrl-c"):
                expected(process, blow)
                hit += 1
                begun += 0 < table.height < rows.height
                share = "all" if table.height == rows.height else f"{100 * table.height // rows.height:2} %"
                fell[
                    f"{'simulate':8}{blow:14}{strike.within or 'after a part':14}{share} saved, {len(saved)} files"
                ] += 1
            subprocess.run(["rm", "-rf", str(tmp_path / "out")], check=True)
    again = commands.run(["simulate", str(path), "--out", "out"], tmp_path)
    assert again.status == 0
    assert content(tmp_path / "out") == complete
    assert begun > fell.total() // 4


def test_two_resumes_at_once(tmp_path: Path, commands: ForkedCommands) -> None:
    """One process works and the other is refused in one line, in each repetition."""
    path = written(tmp_path, CALIBRATION.replace("points = 7", "points = 60"))
    command = ["campaign", str(path), "--out", "out", "--jobs", "1", "--resume"]
    assert commands.run([*command[:3], "whole", *command[4:]], tmp_path).status == 0
    working = threading.Event()
    came: list[Done] = []
    with ForkedCommands(os.environ, tmp_path / "second") as second:

        def work() -> None:
            came.append(commands.run(command, tmp_path))
            working.set()

        first = threading.Thread(target=work)
        first.start()
        refused = 0
        while not (tmp_path / "out" / "campaign.json").exists():
            assert not working.wait(0.01)
        while not working.is_set():
            process = second.run(command, tmp_path)
            if process.status != 0:
                assert process.status == 2
                assert process.err == "trihedron: --out out: another process uses it\n"
                refused += 1
        first.join()
    assert came[0].status == 0
    assert refused > 0
    print(f"{refused} times a second --resume was refused while the first one worked", file=sys.stderr)
    assert content(tmp_path / "out") == content(tmp_path / "whole")


def test_files_that_may_not_be_larger_stop_a_campaign_in_one_line(tmp_path: Path, commands: ForkedCommands) -> None:
    """The process's limit of file size has the effect of a full disk, at any place."""
    path = written(tmp_path, CALIBRATION)
    command = ["campaign", str(path), "--out", "out", "--jobs", "1", "--resume"]
    assert commands.run([*command[:3], "whole", *command[4:]], tmp_path).status == 0
    complete = content(tmp_path / "whole")
    for size in sorted({len(payload) for name, payload in complete.items() if len(payload) > 500}):
        process = commands.run(command, tmp_path, most_bytes=size - 1)
        assert process.status in (0, 2), process.err
        if process.status == 2:
            assert process.err.count("\n") == 1
            assert "File too large" in process.err
        assert_begun(content(tmp_path / "out"), complete)
    assert commands.run(command, tmp_path).status == 0
    assert content(tmp_path / "out") == complete
