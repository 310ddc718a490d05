"""A campaign whose process is struck at chosen calls: what is there is whole, and --resume gives the same bytes."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign_runs import CALIBRATION, PARTS, assert_begun, content, written
from forked_commands import ForkedCommands, Strike, with_temporary_folder

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
SMALL = CALIBRATION.partition("[[compute]]")[0].replace("points = 7", "points = 2")
"""Four calibrations in two files."""


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ForkedCommands]:
    folder = tmp_path_factory.mktemp("commands")
    with with_temporary_folder(folder) as started:
        yield started
    # Of those that were killed, too.
    assert list((folder / "temporary").iterdir()) == []


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, commands: ForkedCommands) -> tuple[Path, dict[str, bytes]]:
    """The campaign, and its folder when nobody struck."""
    folder = tmp_path_factory.mktemp("whole")
    path = written(folder, SMALL)
    assert commands.run(["campaign", str(path), "--out", "out", "--jobs", "1"], folder).status == 0
    return path, content(folder / "out")


@pytest.mark.acceptance
def test_a_campaign_killed_again_and_again(tmp_path, whole, commands):
    """While it writes a partition, with its workers, and while it writes the page."""
    path, there = whole
    command = ["campaign", str(path), "--out", "out", "--jobs", "1", "--resume"]
    files = []
    for within, number, blow in (
        ("write", 400, "kill all"),
        ("write_page", 300, "kill"),
    ):
        done = commands.run(command, tmp_path, strike=Strike(within, PARTS, number, blow))
        assert done.struck, (within, done)
        assert done.status == -9
        files.append(len(list((tmp_path / "out" / "runs").glob("part-*"))))
        assert_begun(content(tmp_path / "out"), there)
    assert files[-1] == 2
    assert commands.run(command, tmp_path).status == 0
    assert content(tmp_path / "out") == there
