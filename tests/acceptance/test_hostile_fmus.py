"""An FMU that misbehaves in each of its eighteen calls, in each of four ways: seventy-two runs."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from campaign_runs import children, command_of, wait_for
from foreign_fmus.hostile import CALLS, WAYS, assert_named_and_kept, build_hostile, hostile_scenario
from scenario_runs import scenario
from trihedron.tools.orchestrator import shared_process, write_scenario

pytestmark = [pytest.mark.acceptance, pytest.mark.skipif(os.name == "nt", reason="the FMU is written for POSIX")]


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMU."""
    return build_hostile(tmp_path_factory.mktemp("hostile")).parent


# Freeing an instance returns no status that could report a failure.
@pytest.mark.parametrize(("call", "way"), [(c, w) for c in CALLS for w in WAYS if (c, w) != ("FreeInstance", "error")])
def test_each_behaviour(hostile: Path, tmp_path: Path, call: str, way: str) -> None:
    assert_named_and_kept(hostile, call, way, tmp_path / "out")


@pytest.mark.parametrize("call", [call for call in CALLS if call not in ("GetString", "FreeInstance")])
def test_each_behaviour_in_one_process_for_all(
    hostile: Path, tmp_path: Path, call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The refusal and the rows are those of separate processes; a process that hangs has no limit there."""
    monkeypatch.setattr(shared_process, "WORTH_EXCHANGES", 1)
    for way in ("error", "exit", "crash"):
        assert_named_and_kept(hostile, call, way, tmp_path / way, together=True)


def test_it_ends_with_us(hostile: Path, tmp_path: Path) -> None:
    """No process is left when ours is killed while an FMU hangs."""
    arguments = hostile_scenario(hostile, "hang_DoStep")
    del arguments["run"]["call_limit_s"]
    write_scenario(scenario(hostile, **arguments), hostile / "forever.toml")
    command = [sys.executable, "-m", "trihedron.tools.cli", "simulate", str(hostile / "forever.toml")]
    with subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as ours:

        def guests() -> list[int]:
            return [pid for pid in children(ours.pid) if b"guest_process" in command_of(pid)]

        wait_for(lambda: len(guests()) == 2)
        time.sleep(1.0)
        remaining = guests()
        ours.send_signal(signal.SIGKILL)
    wait_for(lambda: not any(_is_alive(pid) for pid in remaining))


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{pid}/stat")
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"
