"""Where readings come from, a file that grows, a stream, a serial port: each gives what has come."""

import os
import sys
import time
from pathlib import Path

import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.measure.source import GrowingFile, SerialPort, Source, Stream, source_of


def all_of(source: Source, size: int) -> bytes:
    """So many bytes, as they come."""
    found, ends = b"", time.monotonic() + 20.0
    while len(found) < size and time.monotonic() < ends:
        found += source.read() or b""
    return found


def test_a_file_may_come_later_and_grow_but_not_shrink(tmp_path: Path):
    source = source_of(str(tmp_path / "growing.csv"), 9600)
    assert isinstance(source, GrowingFile)
    assert source.read() == b""
    assert source.trouble.endswith("growing.csv: no such file yet")
    (tmp_path / "growing.csv").write_bytes(b"one\ntw")
    assert source.read() == b"one\ntw"
    assert source.trouble == ""
    with (tmp_path / "growing.csv").open("ab") as file:
        file.write(b"o\n")
    assert source.read() == b"o\n"
    assert source.read() == b""
    (tmp_path / "growing.csv").write_bytes(b"new\n")
    with pytest.raises(InputError, match="has become shorter"):
        source.read()
    source.close()


@pytest.mark.skipif(sys.platform == "win32", reason="a pipe with a name")
def test_a_pipe_with_a_name_is_read_to_its_end(tmp_path: Path):
    os.mkfifo(tmp_path / "pipe")
    # who reads waits for who writes, unless he is both
    write = os.open(tmp_path / "pipe", os.O_RDWR)
    source = source_of(str(tmp_path / "pipe"), 9600)
    assert isinstance(source, Stream)
    assert source.read() == b""
    os.write(write, b"a,b\n")
    assert all_of(source, 4) == b"a,b\n"
    os.close(write)
    ends = time.monotonic() + 20.0
    while source.read() is not None:
        assert time.monotonic() < ends
    source.close()


@pytest.mark.skipif(sys.platform == "win32", reason="a terminal stands for the port")
def test_a_serial_port_is_read_from_its_first_whole_line_and_opened_again():
    pytest.importorskip("serial")
    import pty

    ours, theirs = pty.openpty()
    source = source_of(os.ttyname(theirs), 115200)
    assert isinstance(source, SerialPort)
    os.write(ours, b"34.5,1\n0.5,1,2\n")
    assert all_of(source, 8) == b"0.5,1,2\n"
    os.close(theirs)
    os.close(ours)
    ends = time.monotonic() + 20.0
    while not source.trouble and time.monotonic() < ends:
        source.read()
    assert "is lost" in source.trouble
    source.close()


def test_what_is_no_source_is_said(tmp_path: Path):
    for name, said in (
        (str(tmp_path / "none" / "x.csv"), "there is no folder"),
        ("/dev/ttyNONE7", "no such device"),
    ):
        with pytest.raises(InputError, match=said):
            source_of(name, 9600)
    with pytest.raises(InputError, match="--baud 3: must be"):
        source_of("x.csv", 3)
    with pytest.raises(InputError, match="is not a regular file"):
        source_of(str(tmp_path), 9600).read()
