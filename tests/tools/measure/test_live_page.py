"""The page of a measurement: access, content; briefly in a real browser."""

import http.client
import json
from dataclasses import replace
from pathlib import Path

import pytest
from test_measurement import POSITIONS, begun, fed

from browser import Window
from simulated_table import SimulatedTable
from trihedron.tools.live import PageServer
from trihedron.tools.measure import Measurement, Moment, read_programme


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
def server(moment: Moment):
    page = PageServer(0)
    page.show(moment)
    yield page
    page.close()


def asked(server: PageServer, method: str, path: str, body: str | None = None, **headers: str) -> tuple[int, str]:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)
    sent = {"Host": f"127.0.0.1:{server.port}"} | {name.replace("_", "-"): value for name, value in headers.items()}
    connection.request(method, path, body, sent)
    answer = connection.getresponse()
    text = answer.read().decode()
    connection.close()
    return answer.status, text


def test_only_this_machine_with_the_token_and_from_this_page_is_answered(server: PageServer):
    address, origin = f"/{server.token}/", f"http://127.0.0.1:{server.port}"
    assert server.address == origin + address
    assert asked(server, "GET", address + "now")[0] == 200
    assert asked(server, "GET", "/")[0] == 404
    assert asked(server, "GET", "/wrong/now")[0] == 404
    assert asked(server, "GET", address + "../../etc/passwd")[0] == 404
    assert asked(server, "GET", address + "now", Host=f"evil.example:{server.port}") == (403, "another host")
    word, kind = json.dumps({"word": "end"}), {"Content_Type": "application/json"}
    assert asked(server, "POST", address + "word", word, **kind) == (403, "another origin")
    assert asked(server, "POST", address + "word", word, Origin="http://evil.example", **kind)[0] == 403
    assert asked(server, "POST", address + "word", word, Origin=origin, Content_Type="text/plain")[0] == 415
    assert asked(server, "POST", address + "word", "x" * 5000, Origin=origin, **kind)[0] == 413
    assert asked(server, "POST", address + "word", "{", Origin=origin, **kind)[0] == 400
    assert asked(server, "POST", address + "word", '{"word": "add"}', Origin=origin, **kind)[0] == 400
    assert server.words() == []
    assert asked(server, "POST", address + "word", word, Origin=origin, **kind)[0] == 204
    assert server.words() == [{"word": "end"}]


def test_what_a_file_says_is_shown_and_never_run(server: PageServer, moment: Moment):
    server.show(replace(moment, trouble="<script>alert(1)</script>"))
    text = asked(server, "GET", f"/{server.token}/now")[1]
    assert "<script>" not in text
    assert "&lt;script&gt;" in text


def test_the_page_shows_what_is_and_says_when_it_is_alone(server: PageServer, moment: Moment, window: Window):
    for width, dark in ((1280, False), (400, True)):
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
    window.page.locator("button:text('repeat')").first.click()
    window.page.wait_for_timeout(200)
    assert server.words() == [{"word": "repeat", "visit": 1}]
    server.close()
    window.page.wait_for_selector("#lost:visible", timeout=8000)
    assert "connection to the program is lost" in window.page.inner_text("#lost")


def test_a_port_that_is_taken_is_said(server: PageServer, tmp_path: Path):
    from trihedron.tools.errors import InputError

    with pytest.raises(InputError, match=f"--port {server.port}: "):
        PageServer(server.port)
