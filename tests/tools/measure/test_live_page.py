"""The page of a measurement: access, content; briefly in a real browser."""

import http.client
import json
from dataclasses import replace
from pathlib import Path

import pytest
from test_measurement import POSITIONS, SIGMA, begun, fed, write_positions

import trihedron as th
from browser import Window
from simulated_table import SimulatedTable
from trihedron.tools.measure import Measurement, Moment, read_programme
from trihedron.tools.workbench import Desk, DeskServer, TableView


class Nothing:
    """A source without data."""

    name, trouble = "growing.csv", ""

    def read(self) -> bytes:
        return b""

    def close(self) -> None:
        return


@pytest.fixture(scope="module")
def measurement(tmp_path_factory) -> Measurement:
    """Return a measurement of three positions, the second knocked."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "plan.csv").write_text("alpha_deg,beta_deg\n" + "".join(f"{a},{b}\n" for a, b in POSITIONS))
    table = SimulatedTable(folder / "growing.csv")
    for k, at in enumerate(POSITIONS[:3]):
        table.go(*at, knocked=k == 1)
    measurement_begun = begun(read_programme(folder / "plan.csv"), folder / "<b>m.csv")
    fed(measurement_begun, table.file.read_bytes())
    return measurement_begun


@pytest.fixture
def moment(measurement: Measurement) -> Moment:
    return measurement.moment(Nothing(), 0.0)


@pytest.fixture
def table(measurement: Measurement, moment: Moment) -> TableView:
    shown = TableView(Desk(), measurement.files.positions_file)
    shown.show(moment)
    return shown


@pytest.fixture
def server(table: TableView):
    page = DeskServer(table.desk, table=table)
    yield page
    page.close()


def answer_to(server: DeskServer, method: str, path: str, body: str | None = None, **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    sent = {"Host": f"127.0.0.1:{server.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, sent)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


@pytest.mark.acceptance
def test_only_this_machine_with_the_token_and_from_this_page_is_answered(server: DeskServer, table: TableView):
    address, origin = f"/{server.token}/", f"http://127.0.0.1:{server.port}"
    assert server.address == origin + address
    assert answer_to(server, "GET", address + "now")[0] == 200
    assert answer_to(server, "GET", "/")[0] == 404
    assert answer_to(server, "GET", "/wrong/now")[0] == 404
    assert answer_to(server, "GET", address + "../../etc/passwd")[0] == 404
    assert answer_to(server, "GET", address + "now", Host=f"evil.example:{server.port}") == (403, "another host")
    word, kind = json.dumps({"word": "end"}), {"Content_Type": "application/json"}
    assert answer_to(server, "POST", address + "word", word, **kind) == (403, "another origin")
    assert answer_to(server, "POST", address + "word", word, Origin="http://evil.example", **kind)[0] == 403
    assert answer_to(server, "POST", address + "word", word, Origin=origin, Content_Type="text/plain")[0] == 415
    assert answer_to(server, "POST", address + "word", "x" * 5000, Origin=origin, **kind)[0] == 413
    assert answer_to(server, "POST", address + "word", "{", Origin=origin, **kind)[0] == 400
    assert answer_to(server, "POST", address + "word", '{"word": "add"}', Origin=origin, **kind)[0] == 400
    assert table.words() == []
    assert answer_to(server, "POST", address + "word", word, Origin=origin, **kind)[0] == 204
    assert table.words() == [{"word": "end"}]


def test_what_a_file_says_is_shown_and_never_run(server: DeskServer, table: TableView, moment: Moment):
    table.show(replace(moment, trouble="<script>alert(1)</script>"))
    text = answer_to(server, "GET", f"/{server.token}/now")[1]
    assert "<script>" not in text
    assert "&lt;script&gt;" in text


@pytest.mark.acceptance
def test_the_page_shows_what_is_and_says_when_it_is_alone(server: DeskServer, table: TableView, window: Window):
    for width, dark in ((1280, False), (400, True)):
        assert window.complaints == []
        window.open(server.address, width, dark=dark)
        window.page.wait_for_selector("#settings")
        widths = window.page.evaluate("[document.documentElement.scrollWidth, innerWidth]")
        assert widths == [width, width]
    text = window.page.inner_text("body")
    assert "Repeat position 2 of 12: α 20°, β 145°" in text
    assert "a knock in row" in text
    assert window.page.locator("tr .state-done, td.state-done").count() == 2
    assert window.complaints == []
    assert not window.page.is_visible("#lost")
    with window.page.expect_response("**/word"):
        window.page.locator("button:text('repeat')").first.click()
    assert table.words() == [{"word": "repeat", "visit": 1}]
    server.close()
    window.page.wait_for_selector("#lost:visible", timeout=60_000)
    assert "connection to the program is lost" in window.page.inner_text("#lost")


def test_a_port_that_is_taken_is_said(server: DeskServer, tmp_path: Path):
    from trihedron.tools.errors import InputError

    with pytest.raises(InputError, match=f"--port {server.port}: "):
        DeskServer(Desk(), server.port)


@pytest.mark.acceptance
def test_the_positions_so_far_are_calculated_on_the_page_again_after_each_rest(tmp_path: Path, window: Window):
    """`measure` is a view of the page of `open`: its record stands below, and its result follows the measurement."""
    write_positions(tmp_path / "plan.csv")
    growing = SimulatedTable(tmp_path / "growing.csv")
    measurement = begun(read_programme(tmp_path / "plan.csv"), tmp_path / "monday.csv")
    shown = TableView(Desk(), measurement.files.positions_file)
    page = DeskServer(shown.desk, table=shown)
    length = 0
    verdicts = []
    try:
        window.open(page.address, 1280)
        for number, at in enumerate((*POSITIONS, (0, 0))):
            growing.go(*at)
            readings = growing.file.read_bytes()
            measurement.feed(readings[length:])
            length = len(readings)
            shown.show(measurement.moment(Nothing(), 0.0))
            if number == 3:
                window.page.click("#files button:text('monday.positions.csv')")
                window.page.fill("[name=noise_bound]", str(SIGMA))
                window.page.click("#commands button:text('Calibrate'):enabled", timeout=60_000)
            if number in (3, 12):
                count = len(th.read_record(measurement.files.positions_file))
                expected = th.calibrate(measurement.files.positions_file, noise_bound=SIGMA)
                window.page.wait_for_selector(f"#record-about:has-text('{count} rows')", timeout=60_000)
                window.page.wait_for_selector(f"#verdict:has-text('{expected.verdict.capitalize()}')", timeout=60_000)
                verdicts.append(expected.verdict)
    finally:
        page.close()
        measurement.files.close()
    assert verdicts == ["insufficient", "consistent"]
    assert window.complaints == []
