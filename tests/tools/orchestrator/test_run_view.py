"""A run that is shown while it goes on: rows on standard output, and a page for this machine alone."""

import re
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import closing
from pathlib import Path

import polars as pl
import pytest

from browser import Window
from foreign_fmus.habits import Habit, build_habit
from trihedron.tools import cli, library
from trihedron.tools.errors import InputError
from trihedron.tools.live.run_view import POINTS, RunPage
from trihedron.tools.orchestrator.loops import Pacer


def read(address: str) -> str:
    with urllib.request.urlopen(address, timeout=5.0) as answer:
        return answer.read().decode()


def rows(first: int, count: int) -> pl.DataFrame:
    times = [0.01 * k for k in range(first, first + count)]
    return pl.DataFrame({"time_s": times, "a.h_m": times, "<b>": [k % 2 == 0 for k in range(count)]})


@pytest.mark.acceptance
def test_rows_on_standard_output_are_those_of_the_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    fmu = build_habit(Habit("shown"), 2, "CoSimulation", tmp_path)
    words = ["simulate", "--realtime", fmu.name, "--stop", "0.4", "--step", "0.04", "--out", "run", "--live", "-"]
    assert cli.main(words) == 0
    printed = capsys.readouterr()
    assert printed.out == (tmp_path / "run" / "run.csv").read_text()
    assert printed.out.count("\n") == 12
    assert "real time times 1: 10 steps of 40 ms" in printed.err
    assert str(Path("run", "run.csv")) in printed.err
    assert cli.main([*words, "--json", "-"]) == 2
    assert "--json - writes to standard output, too" in capsys.readouterr().err
    assert cli.main([*words, "--quiet"]) == 0
    assert capsys.readouterr() == (printed.out, "")
    for missing in (["--live", "--out", "run"], ["--out", "run", "--live"]):
        assert cli.main(["simulate", fmu.name, *missing]) == 2
        assert "--live: give a port, 0 for any free one, or -" in capsys.readouterr().err
    with pytest.raises(InputError, match="--live web: give a port"):
        library.simulate(fmu, live="web")


@pytest.mark.acceptance
def test_a_reader_that_goes_away_does_not_end_the_run(tmp_path: Path) -> None:
    fmu = build_habit(Habit("shown"), 2, "CoSimulation", tmp_path)
    command = [sys.executable, "-m", "trihedron", "simulate", fmu.name, "--stop", "1", "--step", "0.02"]
    command += ["--realtime", "--live", "-", "--out", "run"]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as process:
        assert process.stdout is not None
        assert process.stdout.readline().startswith(b"time_s,")
        process.stdout.close()
        assert process.wait(60) == 0
    assert pl.read_csv(tmp_path / "run" / "run.csv").height == 51


@pytest.mark.acceptance
def test_the_page_has_the_newest_values_during_the_run(tmp_path: Path) -> None:
    fmu = build_habit(Habit("shown"), 3, "ModelExchange", tmp_path)
    command = [sys.executable, "-m", "trihedron", "simulate", fmu.name, "--stop", "60", "--step", "0.05"]
    command += ["--realtime", "--live", "0", "--set", "u=1"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        (address,) = re.findall(r"http://127\.0\.0\.1:\d+/\S+/", process.stderr.readline())
        until = time.monotonic() + 60.0
        while "polyline" not in (page := read(f"{address}now")):
            assert time.monotonic() < until
            time.sleep(0.1)
        assert "shown3M.x" in page
        later = read(f"{address}now")
        while later == page:
            assert time.monotonic() < until
            time.sleep(0.1)
            later = read(f"{address}now")
        assert process.poll() is None
        process.kill()


def test_the_page_keeps_its_last_row_and_grows_no_further() -> None:
    with closing(RunPage(0)) as page:
        assert "<tr>" not in read(f"{page.address}now")
        for first in range(0, 5000, 250):
            page.show(rows(first, 250))
        content = read(f"{page.address}now")
        assert '<td class="number">49.99</td>' in content
        assert "&lt;b&gt;" in content
        assert "<b>" not in content
        count = content.count(",") / 2
        assert POINTS / 2 < count <= 2 * POINTS
        page.show(pl.DataFrame({"time_s": [50.0], "a.h_m": [float("nan")], "<b>": [True]}))
        assert '<td class="number">nan</td>' in read(f"{page.address}now")
        for wrong in (f"http://127.0.0.1:{page.port}/now", f"http://127.0.0.1:{page.port}/{page.token}/etc"):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                read(wrong)
        with pytest.raises(InputError, match=f"--live {page.port}: "):
            RunPage(page.port)


@pytest.mark.acceptance
def test_the_page_in_a_browser(window: Window) -> None:
    with closing(RunPage(0)) as page:
        page.show(rows(0, 100))
        for width in (360, 1280):
            window.open(page.address, width)
            window.page.wait_for_selector("polyline")
            measured = window.page.evaluate("document.documentElement.scrollWidth")
            assert measured <= width
        assert "The run goes on." in window.page.inner_text("#state")
        assert window.complaints == []
    window.page.get_by_text("The run has ended").wait_for()
    assert "0.99" in window.page.inner_text("#now")


@pytest.mark.acceptance
def test_a_cancelled_request_is_a_complaint_only_on_the_page_that_is_open(window: Window) -> None:
    asks = "for (let i = 0; i < 40; i++) fetch('now', {signal}).catch(() => {})"
    with closing(RunPage(0)) as page:
        page.show(rows(0, 4000))
        for _ in range(4):
            window.open(page.address, 1280)
            window.page.evaluate(f"(signal => {{ {asks}; }})(undefined)")
        window.open(page.address, 1280)
        assert window.complaints == []
        with window.page.expect_event("requestfailed"):
            window.page.evaluate(
                "const stop = new AbortController(), signal = stop.signal;"
                f" {asks}; setTimeout(() => stop.abort(), 5); 0"
            )
        assert f"could not load {page.address}now" in window.complaints


@pytest.mark.acceptance
def test_jitter_and_overruns_are_those_of_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Steps of 10 ms that begin 0, 2, 0 and 14 ms late: the last begins after the next is due."""
    begins = iter([0.0, 0.0, 0.012, 0.02, 0.044])
    monkeypatch.setattr("time.perf_counter", lambda: next(begins))
    pacer = Pacer(0.02, 2.0)
    for step in range(4):
        pacer.wait(step, lambda: False)
    assert pacer.summary() == (
        "real time times 2: 4 steps of 10 ms, delay 4 ms on average, jitter 5.83 ms, largest delay 14 ms, 2 overruns"
    )
