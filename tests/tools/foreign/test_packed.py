"""Packed files, filled-up files and files without a table: read if nothing is doubtful, otherwise refused with
advice."""

import bz2
import gzip
import io
import lzma
import zipfile
from pathlib import Path

import numpy as np
import pytest

from laboratory_files import PLAIN, table
from laboratory_imports import import_proposed, imported, refused, written
from trihedron.tools.foreign import sheet

ROWS = [["1", "0", "20", "25", "1.4", "3.0", "9.2"], ["2", "60", "110", "25", "4.1", "8.3", "-3.4"]]
LAB = table(PLAIN, list(zip(*ROWS, strict=True)))
PACKED = gzip.compress(LAB, mtime=0)
FORCE = [[1.4, 3.0, 9.2], [4.1, 8.3, -3.4]]


def archive() -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("lab.csv", LAB)
    return stream.getvalue()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("packed.csv.gz", PACKED),
        ("two parts.csv.gz", gzip.compress(LAB[:50], mtime=0) + gzip.compress(LAB[50:], mtime=0)),
        ("filled up.csv", LAB + bytes(100)),
        ("wide.csv", LAB.decode().encode("utf-32")),
    ],
    ids=["packed", "in parts", "filled up", "utf-32"],
)
def test_what_holds_the_table_beyond_doubt_is_read(name: str, content: bytes, tmp_path: Path):
    record = imported(tmp_path, content, name=name).record
    assert record.specific_force == pytest.approx(np.array(FORCE))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (PACKED[:-20], "is cut short"),
        (PACKED[:-8] + b"junkjunk", "cannot be unpacked"),
        (bz2.compress(LAB), "is a packed archive; unpack it"),
        (lzma.compress(LAB), "is a packed archive; unpack it"),
        (archive(), "is a ZIP archive, or a workbook cut short; unpack it"),
        (b"\xef\xbb\xbf<html><table><tr><td>1</td></tr></table></html>", "is HTML or XML"),
        (b'<?xml version="1.0"?><Workbook/>', "is HTML or XML"),
        (b'{"a": 1, "b": [1, 2, 3]}', "is JSON"),
        (b"[\n  [1, 2, 3],\n  [1, 2, 3]\n]", "is JSON"),
        (b"%PDF-1.4", "is a PDF"),
        (b"PAR1PAR1", "is not a readable Parquet file"),
    ],
    ids=["cut", "corrupt", "bz2", "xz", "zip", "html", "xml", "json", "json lists", "pdf", "parquet"],
)
def test_what_holds_none_is_told_what_would_be_right(content: bytes, message: str, tmp_path: Path):
    assert message in refused(tmp_path, content)


def test_a_file_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(sheet, "LARGEST", 100_000)
    assert "unpacks to more than 100000 bytes" in refused(tmp_path, gzip.compress(bytes(1_000_000)))


def test_check_and_diagnose_propose_the_import_of_a_packed_file(tmp_path: Path, capsys):
    path = written(tmp_path, PACKED, "lab.csv.gz")
    assert "is packed by gzip" in import_proposed(path, capsys)
