"""`trihedron open`: five journeys of a person in a real browser, with the numbers of the commands."""

import http.client
import json
import shlex
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import trihedron as th
from browser import Window
from by_hand import GRAVITY, Instrument
from generator.stands import random_bench, simulated
from hand_sessions import directions, ferraris, hand_moved, poses
from trihedron.tools.cli import advice, main
from trihedron.tools.errors import InputError
from trihedron.tools.records import write_record
from trihedron.tools.workbench import DeskServer, open_records

SECONDS = 120_000
"""Longest wait for an answer, in ms: of a busy machine."""


class Visitor:
    """A person at the page, whose clicks and words are counted.

    Attributes
    ----------
    clicks : int
    """

    def __init__(self, window: Window, server: DeskServer, width: int = 1400) -> None:
        self.window, self.page, self.clicks = window, window.page, 0
        window.open(server.address, width)
        self.page.wait_for_selector("#files button")

    def click(self, what: str) -> None:
        self.clicks += 1
        self.page.click(what)

    def type(self, where: str, text: str) -> None:
        self.clicks += 1
        self.page.fill(where, text)

    def choose(self, where: str, word: str) -> None:
        self.clicks += 1
        self.page.select_option(where, word)

    def answered(self, act: Callable[[], None]) -> str:
        """Act, wait for the new answer, and return its verdict."""
        number = self.page.evaluate("state.answered")
        act()
        self.wait_for(f"state.answered > {number} && state.running === null && shownAnswer === state.answered")
        return self.page.inner_text("#verdict")

    def wait_for(self, expression: str) -> None:
        """Wait until something is true on the page, whose policy lets nothing be evaluated in it."""
        end = time.monotonic() + SECONDS / 1000.0
        while not self.page.evaluate(expression):
            assert time.monotonic() < end, expression
            self.page.wait_for_timeout(50)

    def parameters(self) -> dict[str, float | None]:
        """Return the estimates that the page has."""
        return {row["symbol"]: row["estimate"] for row in self.page.evaluate("entry().answer.parameters")}

    def saved(self, what: str) -> Path:
        """Save something; return its file."""
        self.click(what)
        self.page.wait_for_selector("#note:not(:empty)", timeout=SECONDS)
        return Path(self.page.inner_text("#note").removeprefix("Written: "))


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., DeskServer]]:
    """Return a function that serves the page of some files, in a working folder of its own."""
    monkeypatch.chdir(tmp_path)
    servers = []

    def serve(*files: Path) -> DeskServer:
        servers.append(open_records(*files, advise=advice))
        return servers[-1]

    yield serve
    for server in servers:
        server.close()


def by_command(*words: str) -> dict[str, Any]:
    """Run a command and return its JSON."""
    assert main([*words, "--json", "by-command.json", "--quiet"]) == 0
    return json.loads(Path("by-command.json").read_text())


def estimates(content: dict[str, Any]) -> dict[str, float]:
    return {row["symbol"]: row["estimate"] for row in content["parameters"]}


def is_same(shown: dict[str, float | None], expected: dict[str, float]) -> bool:
    """Whether the page has the numbers of a command, to the seven figures that it shows."""
    return shown == {symbol: float(f"{value:.7g}") for symbol, value in expected.items()}


def wrong_table(folder: Path) -> Path:
    """Return a position record of 24 positions, one with an angle that is wrong by 0.3 degrees."""
    rng = np.random.default_rng(3)
    noise = rng.uniform(-1e-5, 1e-5, (24, 3))
    made = simulated(random_bench(rng), noise=noise)
    path = folder / "table.csv"
    write_record(made, path)
    table = pl.read_csv(path, comment_prefix="#")
    angle = table["alpha_deg"].to_list()
    angle[11] += 0.3
    table.with_columns(alpha_deg=pl.Series(angle)).write_csv(path)
    return path


def workbook(table: Path) -> Path:
    """Return a workbook with a table's columns, its accelerometers without a unit."""
    names = {"position": "Nr", "time_s": "Time [s]", "alpha_deg": "alpha [deg]", "beta_deg": "beta [deg]"}
    names |= {f"f{axis}_mps2": f"A{axis}" for axis in (1, 2, 3)}
    path = table.with_suffix(".xlsx")
    pl.read_csv(table).select(list(names)).rename(names).write_excel(path)
    return path


@pytest.mark.acceptance
def test_a_workbook_with_a_wrong_angle_becomes_a_corrected_record(tmp_path: Path, window: Window, opened) -> None:
    wrong_table(tmp_path)
    visitor = Visitor(window, opened(workbook(tmp_path / "table.csv")))
    visitor.page.wait_for_selector("#import td")
    assert "beta [deg]" in visitor.page.inner_text("#import th >> nth=3")
    visitor.choose("#import select", "m/s2")
    visitor.click("#make")
    visitor.wait_for("state.files.length === 2 && state.files[1].about")
    visitor.type("[name=noise_bound]", "1e-5")
    visitor.answered(lambda: visitor.click("[data-command=calibrate]"))
    verdict = visitor.answered(lambda: visitor.click("[data-command=diagnose]"))
    assert "Row 12 is wrong" in verdict
    assert visitor.page.inner_text("#answer-about") == "trihedron diagnose table.record.csv --noise-bound 1e-5"
    # The button is about the file of the answer, whichever is looked at meanwhile.
    visitor.page.click("#files button:text-is('table.xlsx')")
    count = visitor.page.evaluate("state.answered")
    visitor.click("#act button")
    visitor.wait_for(f"state.answered === {count + 2} && state.running === null")
    visitor.page.click("#files button:text-is('table.record.csv')")
    # Both answers are new, each with what it was before; a click shows the one or the other.
    assert visitor.page.locator("#before th[colspan]").all_inner_texts() == ["Calibrate", "Diagnose"]
    assert "Row 12 is wrong" in visitor.page.inner_text("#before")
    visitor.click("#answers button:has-text('Calibrate')")
    assert visitor.page.inner_text("#verdict").startswith("Consistent")
    corrected = visitor.saved("[data-save=corrected]")
    assert th.read_record(corrected).about["corrected_by"]
    content = by_command("calibrate", "table.record.csv", "--noise-bound", "1e-5")
    assert is_same(visitor.parameters(), estimates(content))
    assert "left_out = [12]" in (tmp_path / "table.record.decisions.toml").read_text()
    assert visitor.page.inner_text("#command") == "trihedron calibrate table.record.csv --noise-bound 1e-5"
    assert visitor.clicks <= 9
    assert window.complaints == []


@pytest.mark.acceptance
def test_faces_of_a_phone_log_are_named(tmp_path: Path, window: Window, opened) -> None:
    _, table = ferraris(2)
    path = tmp_path / "phone.csv"
    faces = table.filter(pl.col("part").str.len_chars() == 2).drop("part", "w1_radps", "w2_radps", "w3_radps")
    time = 0.01 * np.arange(faces.height)
    faces.with_columns(time_s=pl.Series(time)).write_csv(path)
    visitor = Visitor(window, opened(path))
    visitor.page.wait_for_selector("#rests tbody tr", timeout=SECONDS)
    assert visitor.page.locator("#rests tbody tr").count() == 6
    visitor.type("[name=gravity]", str(GRAVITY))
    visitor.answered(lambda: visitor.click("[data-command=calibrate]"))
    for number, face in enumerate(("+1", "-1", "+2", "-2", "+3", "-3"), start=1):
        visitor.answered(lambda n=number, f=face: visitor.choose(f"[aria-label='Face of rest {n}']", f))
    content = by_command("calibrate", "phone.csv", "--gravity", str(GRAVITY))
    assert is_same(visitor.parameters(), estimates(content))
    assert sum(row["determined"] for row in content["parameters"]) >= 6
    assert visitor.clicks <= 9
    assert window.complaints == []


@pytest.mark.acceptance
def test_a_bad_rest_of_a_hand_moved_log_is_moved_cut_and_left_out(tmp_path: Path, window: Window, opened) -> None:
    _, table = hand_moved(4)
    path = tmp_path / "walk.csv"
    table.write_csv(path)
    visitor = Visitor(window, opened(path))
    visitor.page.wait_for_selector("#rests tbody tr", timeout=SECONDS)
    count = visitor.page.locator("#rests tbody tr").count()
    visitor.type("[name=gravity]", str(GRAVITY))
    visitor.answered(lambda: visitor.click("[data-command=calibrate]"))
    visitor.answered(lambda: visitor.click("[aria-label='Leave out rest 3']"))
    edge = visitor.page.locator(".panel").first.locator(".edge[data-rest='5'][data-side='1']")
    visitor.page.locator(".panel").first.scroll_into_view_if_needed()
    box = edge.bounding_box()
    assert box is not None

    def drag() -> None:
        visitor.clicks += 1
        visitor.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 40)
        visitor.page.mouse.down()
        visitor.page.mouse.move(box["x"] - 8, box["y"] + 40, steps=3)
        visitor.page.mouse.up()

    ends = visitor.page.input_value("[aria-label='End of rest 6 [s]']")
    visitor.answered(drag)
    visitor.wait_for(f"document.querySelector(\"[aria-label='End of rest 6 [s]']\").value !== '{ends}'")
    visitor.answered(lambda: visitor.click("[aria-label='Cut rest 8']"))
    visitor.wait_for(f"document.querySelectorAll('#rests tbody tr').length === {count}")
    expected = estimates(by_command("calibrate", "walk.csv", "--gravity", str(GRAVITY)))
    assert is_same(visitor.parameters(), expected)
    visitor.answered(lambda: visitor.click("#undo"))
    visitor.answered(lambda: visitor.click("#undo"))
    visitor.answered(lambda: visitor.click("#undo"))
    assert not (tmp_path / "walk.decisions.toml").exists()
    assert visitor.clicks <= 8
    assert window.complaints == []


@pytest.mark.acceptance
def test_a_hidden_effect_is_found_and_exported(tmp_path: Path, window: Window, opened) -> None:
    path = tmp_path / "hidden.csv"
    write_record(th.hidden(11, "quadratic").record, path)
    visitor = Visitor(window, opened(path))
    visitor.type("[name=noise_bound]", "1e-5")
    visitor.answered(lambda: visitor.click("[data-command=diagnose]"))
    content = by_command("diagnose", "hidden.csv", "--noise-bound", "1e-5")
    assert content["verdict"] == "explained"
    assert visitor.page.locator("#explanations details").count() == len(content["explanations"])
    visitor.click("#explanations summary")
    assert visitor.page.locator("#explanations td").count() > 0
    shown = visitor.page.frame_locator("#explanations iframe").first
    shown.locator("h2", has_text="Residuals before and after").wait_for(timeout=SECONDS)
    assert shown.get_by_role("img", name="What the explanation adds to accelerometer").is_visible()
    folder = visitor.saved("[data-save=fmu]")
    assert list(folder.glob("*.fmu"))
    assert visitor.clicks <= 5
    assert window.complaints == []


@pytest.mark.acceptance
def test_three_runs_are_calibrated_together(tmp_path: Path, window: Window, opened) -> None:
    instrument = Instrument(7)
    paths = []
    for number in range(3):
        rng = np.random.default_rng(100 + number)
        path = tmp_path / f"run{number}.csv"
        poses(instrument, directions(rng, 8), rng.uniform(-1e-4, 1e-4, (8, 3))).write_csv(path)
        paths.append(path)
    visitor = Visitor(window, opened(*paths), 1024)
    visitor.wait_for("state.files.length === 3 && state.files.every(file => file.about)")
    visitor.type("[name=gravity]", str(GRAVITY))
    visitor.click("[aria-label='Calculate with run1.csv']")
    visitor.click("[aria-label='Calculate with run2.csv']")
    verdict = visitor.answered(lambda: visitor.click("[data-command=calibrate]"))
    content = by_command("calibrate", "run0.csv", "run1.csv", "run2.csv", "--gravity", str(GRAVITY))
    assert is_same(visitor.parameters(), estimates(content))
    assert verdict
    assert "run0.csv run1.csv run2.csv" in visitor.page.inner_text("#command")
    rows = visitor.page.locator("#files tbody tr").all_inner_texts()
    assert [row.split("\t")[1:4] for row in rows] == [[path.name, "pose record", "8"] for path in paths]
    assert all("calibrate, together" in row for row in rows)
    assert visitor.clicks <= 5
    assert window.complaints == []


@pytest.mark.acceptance
def test_everything_is_done_by_the_keyboard(tmp_path: Path, window: Window, opened) -> None:
    _, table = hand_moved(4, 8)
    log = table.rename({f"f{axis}_mps2": f"acc_{axis}" for axis in (1, 2, 3)})
    log.write_csv(tmp_path / "log.csv")
    visitor = Visitor(window, opened(tmp_path / "log.csv"))
    page = visitor.page

    def reach(what: str) -> None:
        """Go on with the tabulator to the next element that a selector names."""
        for _ in range(150):
            page.keyboard.press("Tab")
            if page.evaluate(f"document.activeElement.matches({json.dumps(what)})"):
                return
        raise AssertionError(f"{what} is not reached")

    def press(what: str, key: str = "Enter") -> None:
        reach(what)
        page.keyboard.press(key)

    def typed(what: str, text: str) -> None:
        reach(what)
        page.keyboard.press("Control+A")
        page.keyboard.type(text)

    def rests() -> int:
        return page.evaluate("rests.length")

    page.wait_for_selector("#import select", timeout=SECONDS)
    typed("#import select", "m/s2")
    page.keyboard.press("Enter")
    page.wait_for_selector("#make", timeout=SECONDS)
    press("#make")
    visitor.wait_for("state.files.length === 2 && rests.length > 5")
    count = rests()
    press("[data-zoom=in]")
    visitor.wait_for("span[0] > 1")
    press("[data-zoom=all]")
    visitor.wait_for("span[0] < 1")
    press("[aria-label='Leave out rest 3']")
    visitor.wait_for(f"rests.length === {count - 1}")
    # The keyboard stays in the list.
    assert page.evaluate("document.activeElement.getAttribute('aria-label')") == "Leave out rest 3"
    press("[aria-label='Cut rest 3']")
    visitor.wait_for(f"rests.length === {count}")
    press("[aria-label='Join rest 3 with the next']")
    visitor.wait_for(f"rests.length === {count - 1}")
    typed("[aria-label='Face of rest 4']", "+1")
    visitor.wait_for("rests[3].face === '+1'")
    typed("[aria-label='End of rest 5 [s]']", str(page.evaluate("rests[4].to_s") - 0.5))
    page.keyboard.press("Enter")
    visitor.wait_for("rests[4].to_s - rests[4].from_s < 2.4")
    typed("#new-from", "10.2")
    typed("#new-to", "12.5")
    press("#add-rest")
    visitor.wait_for(f"rests.length === {count}")
    press("#undo")
    visitor.wait_for(f"rests.length === {count - 1}")
    for _ in range(4):
        page.keyboard.press("Enter")
    visitor.wait_for(f"rests.length === {count - 1} && rests[3].face === ''")
    press("#undo")
    visitor.wait_for(f"rests.length === {count} && !state.files[1].undo")
    page.evaluate("document.activeElement.blur()")
    typed("[name=gravity]", str(GRAVITY))
    visitor.answered(lambda: press("[data-command=calibrate]"))
    content = by_command("calibrate", "log.record.csv", "--gravity", str(GRAVITY))
    assert is_same(visitor.parameters(), estimates(content))
    press("[data-save=json]")
    page.wait_for_selector("#note:not(:empty)", timeout=SECONDS)
    assert json.loads((tmp_path / "log.record.calibration.json").read_text())["verdict"] == content["verdict"]
    press("#export")
    visitor.wait_for("document.getElementById('note').textContent.includes('imucal')")
    press("#page-details summary")
    page.frame_locator("#page").locator("h1").wait_for(timeout=SECONDS)
    assert window.complaints == []


# Without a browser


def answer_to(server: DeskServer, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, Any]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    sent = {"Host": f"127.0.0.1:{server.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, sent)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content


def reply(server: DeskServer, **content: Any) -> dict[str, Any]:
    """Return the answer of the page to a request."""
    headers = {"Origin": f"http://127.0.0.1:{server.port}", "Content_Type": "application/json"}
    status, body = answer_to(server, "POST", f"/{server.token}/do", json.dumps(content).encode(), **headers)
    assert status == 200
    return json.loads(body)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DeskServer]:
    """Return a server of a table in a folder of its own, for tests that change neither."""
    folder = tmp_path_factory.mktemp("shared")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        server = open_records(wrong_table(folder))
    yield server
    server.close()


@pytest.mark.acceptance
def test_only_this_machine_with_the_token_and_from_this_page_is_answered(shared: DeskServer) -> None:
    server = shared
    address, origin = f"/{server.token}/", f"http://127.0.0.1:{server.port}"
    assert answer_to(server, "GET", address + "state")[0] == 200
    assert answer_to(server, "GET", "/state")[0] == 404
    assert answer_to(server, "GET", address + "../table.csv")[0] == 404
    assert answer_to(server, "GET", address + "state", Host=f"evil.example:{server.port}")[0] == 403
    body, kind = b'{"do": "stop"}', {"Content_Type": "application/json"}
    assert answer_to(server, "POST", address + "do", body, **kind)[0] == 403
    assert answer_to(server, "POST", address + "do", body, Origin="http://evil.example", **kind)[0] == 403
    assert answer_to(server, "POST", address + "do", body, Origin=origin, Content_Type="text/plain")[0] == 415
    assert answer_to(server, "POST", address + "drop?x.csv", b"a", Origin="http://evil.example")[0] == 403


REFUSED: list[dict[str, Any]] = [
    {"do": "run", "command": "import", "files": [0]},
    {"do": "run", "command": "calibrate", "files": [7]},
    {"do": "run", "command": "calibrate", "files": "all"},
    {"do": "decide", "file": 0, "decisions": {"left_out": [99]}},
    {"do": "decide", "file": 0, "decisions": {"path": "/etc/passwd"}},
    {"do": "decide", "file": 3, "decisions": {}},
    {"do": "save", "what": "json"},
    {"do": "anything"},
]


def test_what_cannot_be_done_is_refused_in_one_line(shared: DeskServer) -> None:
    for content in REFUSED:
        answer = reply(shared, **content)
        assert answer["refusal"], content
        assert "\n" not in answer["refusal"]
    assert sorted(path.name for path in shared.folder.iterdir()) == ["table.csv"]


@pytest.mark.acceptance
def test_addresses_that_ask_for_nothing_are_refused_in_one_line(shared: DeskServer) -> None:
    server = shared
    for query in (
        "lines?file=9",
        "lines?file=0&from=a&to=1",
        "lines?file=0&from=0&to=nan",
        "rests?file=0",
        "rests",
        "page",
    ):
        status, body = answer_to(server, "GET", f"/{server.token}/{query}")
        assert status == (404 if query == "page" else 200), query
        refusal = body.decode() if query == "page" else json.loads(body)["refusal"]
        assert "\n" not in refusal
        assert "fault of the program" not in refusal


@pytest.mark.acceptance
def test_a_dropped_file_is_kept_in_the_working_folder_and_replaces_none(tmp_path: Path, opened) -> None:
    server, folder = opened(wrong_table(tmp_path)), tmp_path
    origin = {"Origin": f"http://127.0.0.1:{server.port}"}
    content = (folder / "table.csv").read_bytes()
    (folder / "folder").mkdir()
    for name, body, expected in (
        ("../outside.csv", content, {"file": 1}),
        ("outside.csv", content, {"file": 1}),
        ("table.csv", b"other", "another file of this name"),
        (".hidden", content, "no name"),
        ("n" * 300, content, "File name too long"),
        ("folder", content, "folder: Is a directory"),
    ):
        status, answer = answer_to(server, "POST", f"/{server.token}/drop?{name}", body, **origin)
        assert status == 200
        told_back = json.loads(answer)
        assert told_back == expected or expected in told_back["refusal"]
        assert "Errno" not in told_back.get("refusal", "")
    with socket.create_connection(("127.0.0.1", server.port), timeout=60) as half:
        head = f"POST /{server.token}/drop?half.csv HTTP/1.1\r\nHost: 127.0.0.1:{server.port}\r\n"
        half.sendall(f"{head}Origin: {origin['Origin']}\r\nContent-Length: 1000\r\n\r\n1,2,3".encode())
        half.shutdown(socket.SHUT_WR)
        assert b" 400 " in half.recv(100)
    assert not (folder / "half.csv").exists()
    assert (folder / "outside.csv").read_bytes() == content
    assert (folder / "table.csv").read_bytes() == content


def answered(server: DeskServer, count: int) -> None:
    """Wait for an answer or a refusal."""
    end = time.monotonic() + SECONDS / 1000.0
    while server.desk.answered < count:
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.acceptance
def test_a_record_that_changes_while_it_is_open_is_refused(tmp_path: Path, opened) -> None:
    path = wrong_table(tmp_path)
    server = opened(path)
    assert reply(server, do="decide", file=0, decisions={"left_out": [12]}) == {}
    pl.read_csv(path).with_columns(f1_mps2=pl.col("f1_mps2") + 1e-3).write_csv(path)
    reply(server, do="run", command="calibrate", files=[0], options={"noise_bound": "1e-5"})
    answered(server, 1)
    assert "has changed since it was opened" in server.desk.refusal
    assert server.desk.answer is None


@pytest.mark.acceptance
def test_decisions_about_another_content_are_said_and_replaced(tmp_path: Path, opened) -> None:
    path = wrong_table(tmp_path)
    beside = tmp_path / "table.decisions.toml"
    beside.write_text('schema = "trihedron.decisions/1"\nrecord_sha256 = "0"\nleft_out = [2]\n')
    server = opened(path)
    about = server.desk.files[0].about
    assert about is not None
    assert about["decisions"] == {}
    assert any("to another content" in line for line in about["warnings"])
    assert reply(server, do="decide", file=0, decisions={"left_out": [12]}) == {}
    result = th.calibrate(path, noise_bound=1e-5)
    assert result.verdict == "consistent"
    assert result.provenance is not None
    assert result.provenance.decisions == "decisions (table.decisions.toml): position 12 left out"


@pytest.mark.acceptance
def test_a_change_calculates_all_answers_again_diagnoses_last(tmp_path: Path, opened) -> None:
    """What was stopped is outdated; no diagnosis begins that was not asked for."""
    path = wrong_table(tmp_path)
    server = opened(path)
    desk, options = server.desk, {"noise_bound": "1e-5"}
    reply(server, do="run", command="diagnose", files=[0], options=options)
    reply(server, do="stop")
    reply(server, do="run", command="calibrate", files=[0], options=options)
    answered(server, 1)
    reply(server, do="decide", file=0, decisions={"left_out": [1]})
    assert desk.state()["running"]["waiting"] == []
    answered(server, 2)
    assert desk.state()["running"] is None
    reply(server, do="run", command="diagnose", files=[0], options=options)
    answered(server, 3)
    reply(server, do="decide", file=0, decisions={"left_out": [12]})
    running = desk.state()["running"]
    commands = "trihedron calibrate table.csv", "trihedron diagnose table.csv"
    assert (*running["commands"], *running["waiting"]) == commands
    reply(server, do="stop")
    assert [one.outdated for one in desk.answers] == [True, True]
    assert desk.state()["running"] is None
    reply(server, do="again")
    answered(server, 5)
    assert [one.outdated for one in desk.answers] == [False, False]
    diagnosed, calibrated = desk.answers
    for one, before in ((diagnosed, "Row 12 is wrong"), (calibrated, "")):
        assert one.before is not None
        assert before in one.before["verdict"]
        assert one.answer is not None
        assert one.answer["verdict"].startswith("Consistent")


@pytest.mark.acceptance
def test_units_that_the_readings_contradict_are_asked(tmp_path: Path, opened) -> None:
    _, table = hand_moved(4, 8)
    force = [f"f{axis}_mps2" for axis in (1, 2, 3)]
    path = tmp_path / "walk.csv"
    table.with_columns(pl.col(force) / GRAVITY).write_csv(path)
    server = opened(path)
    assert "--set units.force=" in server.desk.files[0].problem
    assert reply(server, do="import", file=0, given={"units.force": "g"}, write=True) == {"file": 1}
    readings = th.read_record(tmp_path / "walk.record.csv").specific_force
    assert np.median(np.linalg.norm(readings, axis=1)) == pytest.approx(GRAVITY, rel=0.1)


@pytest.mark.acceptance
def test_a_log_with_names_of_its_own_is_no_damaged_record(tmp_path: Path, opened) -> None:
    _, table = hand_moved(4, 8)
    names = {"time_s": "Time (s)"} | {f"f{axis}_mps2": f"Acceleration {axis} (m/s^2)" for axis in (1, 2, 3)}
    table.select(list(names)).rename(names).write_csv(tmp_path / "phone.csv")
    (file,) = opened(tmp_path / "phone.csv").desk.files
    assert "row 1" not in file.problem
    assert file.imported is not None
    assert file.imported["command"] == "trihedron import phone.csv --out phone.record.csv"


@pytest.mark.acceptance
def test_command_python_and_corrected_record_are_those_of_the_page(tmp_path: Path, opened) -> None:
    """They have all digits, signs and channels."""
    rng = np.random.default_rng(3)
    path = tmp_path / "turned.csv"
    write_record(simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3))), path)
    names = {"f1_mps2": "f2_mps2", "f2_mps2": "f1_mps2"}
    table = pl.read_csv(path, comment_prefix="#").rename(names)
    table.with_columns(f2_mps2=-pl.col("f2_mps2")).write_csv(path)
    server = opened(path)
    options = {"noise_bound": "1e-5", "gravity": "9.8066501234", "channels": "-2,1,3"}
    reply(server, do="run", command="calibrate", files=[0], options=options)
    answered(server, 1)
    shown = server.desk.answer
    assert shown is not None
    assert "corrected" in shown["gives"]
    corrected = th.read_record(reply(server, do="save", what="corrected")["file"])
    estimates_shown = {row["symbol"]: row["estimate"] for row in shown["parameters"]}
    content = by_command(*shlex.split(shown["command"])[1:])
    assert is_same(estimates_shown, estimates(content))
    spoken: dict[str, Any] = {}
    exec(shown["python"], spoken)
    assert is_same(estimates_shown, {row.symbol: row.estimate for row in spoken["result"].parameters})
    expected = th.apply(spoken["result"], path, channels=["-2,1,3"]).record
    assert np.array_equal(corrected.specific_force, th.read_record(expected).specific_force)


@pytest.mark.acceptance
def test_a_refused_command_leaves_the_result_that_is_shown(tmp_path: Path, opened) -> None:
    """The wrong row beside one left out has the number of its position."""
    first = wrong_table(tmp_path)
    second = tmp_path / "second.csv"
    second.write_bytes(first.read_bytes().replace(b"\n2,", b"\n2,", 1) + b"# second\n")
    server = opened(first, second)
    assert reply(server, do="decide", file=0, decisions={"left_out": [3]}) == {}
    reply(server, do="run", command="diagnose", files=[0], options={"noise_bound": "1e-5"})
    answered(server, 1)
    assert server.desk.answer is not None
    assert server.desk.answer["wrong"] == [12]
    reply(server, do="run", command="noise", files=[1], options={})
    answered(server, 2)
    assert server.desk.refusal
    assert Path(reply(server, do="save", what="json")["file"]).name == "table.diagnosis.json"


@pytest.mark.acceptance
def test_a_damaged_file_is_refused_with_its_damage(tmp_path: Path, opened) -> None:
    book = workbook(wrong_table(tmp_path))
    book.write_bytes(book.read_bytes()[:3000])
    with pytest.raises(InputError, match=r"^table.xlsx: is a ZIP archive, or a workbook cut short"):
        open_records(book)
    lines = (tmp_path / "table.csv").read_text().splitlines()
    (tmp_path / "table.csv").write_text("\n".join([*lines[:9], lines[9][:9], *lines[10:]]))
    (file,) = opened(tmp_path / "table.csv").desk.files
    assert file.problem.startswith("table.csv: row 10: ")
    assert file.about is None


def test_a_file_that_is_not_there_is_refused() -> None:
    with pytest.raises(FileNotFoundError, match=r"absent.csv: no such file"):
        th.open("absent.csv")


@pytest.mark.acceptance
def test_a_series_has_its_rests_moves_limits_spikes_and_gaps(tmp_path: Path, opened) -> None:
    _, table = hand_moved(4, 8)
    force, rate = (table[name].to_numpy().copy() for name in ("f1_mps2", "w1_radps"))
    force[700] += 25.0
    # The third move is beyond the range of a gyro; the fourth is cut.
    rate[1300:1500] = np.clip(rate[1300:1500], -0.3, 0.3)
    spoilt = table.with_columns(f1_mps2=pl.Series(force), w1_radps=pl.Series(np.clip(rate, -0.3, 0.3)))
    spoilt.filter(~pl.Series(np.isin(np.arange(table.height), np.arange(1850, 1900)))).write_csv(tmp_path / "walk.csv")
    server = opened(tmp_path / "walk.csv")
    answer = json.loads(answer_to(server, "GET", f"/{server.token}/rests?file=0")[1])
    marks: dict[str, list[dict[str, Any]]] = {}
    for mark in answer["marks"]:
        marks.setdefault(mark["kind"], []).append(mark)
    assert sorted(marks) == ["gap", "limit", "move", "spike"]
    assert [mark["from_s"] for mark in marks["spike"]] == [pytest.approx(7.0)]
    assert [(mark["from_s"], mark["to_s"]) for mark in marks["gap"]] == [(pytest.approx(18.49), pytest.approx(19.0))]
    ends = {rest["to_s"] for rest in answer["rests"]}
    assert {mark["from_s"] for mark in marks["move"]} <= ends


@pytest.mark.acceptance
def test_a_page_gives_the_numbers_of_the_command_after_each_change(tmp_path: Path, opened) -> None:
    """The page computes only what a change touches; a command computes all anew."""
    _, table = hand_moved(6, 30)
    table.write_csv(tmp_path / "walk.csv")
    server = opened(tmp_path / "walk.csv")
    answer = json.loads(answer_to(server, "GET", f"/{server.token}/rests?file=0")[1])
    rests = [[rest["from_s"], rest["to_s"], ""] for rest in answer["rests"]]
    options = {"gravity": str(GRAVITY)}
    reply(server, do="run", command="calibrate", files=[0], options=options)
    answered(server, 1)
    moved = [*rests[:4], [rests[4][0] + 0.2, rests[4][1] - 0.5, ""], *rests[5:]]
    for count, changed in enumerate((moved, [*moved[:9], *moved[10:]], rests), start=2):
        assert reply(server, do="decide", file=0, decisions={"rests": changed}) == {}
        answered(server, count)
        shown = server.desk.answer
        assert shown is not None
        content = by_command("calibrate", "walk.csv", "--gravity", str(GRAVITY))
        assert is_same({row["symbol"]: row["estimate"] for row in shown["parameters"]}, estimates(content))
        assert f"{len(changed)} rests as marked" in " ".join(shown["warnings"])


@pytest.mark.acceptance
def test_explanations_say_what_tells_them_apart(tmp_path: Path, opened) -> None:
    """A temperature that jumps once is not told from a step in time."""
    rng = np.random.default_rng(11)
    made = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)))
    behind = np.arange(24) >= 11
    made.specific_force[:, 1] += 3e-4 * 9.80665 * behind
    temperature = 20.0 + 5.0 * behind + rng.uniform(-0.5, 0.5, 24)
    write_record(replace(made, temperature=temperature), tmp_path / "jump.csv")
    server = opened(tmp_path / "jump.csv")
    reply(server, do="run", command="diagnose", files=[0], options={"noise_bound": "1e-5"})
    answered(server, 1)
    answer = server.desk.answer
    assert answer is not None
    sentences = [explanation["sentence"] for explanation in answer["explanations"]]
    assert len(sentences) >= 2
    functions = ["function" in sentence for sentence in sentences]
    assert set(functions) == {True, False}
    for number, is_function in enumerate(functions):
        status, content = answer_to(server, "GET", f"/{server.token}/page?answer=0&explanation={number}")
        page = content.decode()
        assert status == 200
        assert "What tells it from the next" in page
        assert "What the explanation adds to accelerometer 2 over" in page
        assert "Residuals against each quantity, before and after" in page
        assert "Largest error over its bound: " in page
        assert ("was not measured: a function" if is_function else "were left out and predicted") in page
    _, first = answer_to(server, "GET", f"/{server.token}/page?explanation=0")
    assert sentences[1].split(" changes")[0].removeprefix("the ") in first.decode()
