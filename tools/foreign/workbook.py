"""Workbooks as sheets of texts: .xlsx, .xlsb, .xls, .ods, checked before anything reads them, read by another process.

What reads them (calamine, in Rust) is not trusted to end well with a corrupt or a malicious one: it gets a ZIP archive
of nothing but the parts that a table needs, as large as they say, and no more memory than tables take.
"""

import io
import json
import re
import subprocess
import sys
import zipfile
import zlib
from pathlib import Path

from ..errors import InputError, nearest
from .numbers import Typed
from .sheet import Sheet

MOST_MEMBERS = 5000
"""Parts of a workbook."""
MOST_BYTES = 400_000_000
"""Bytes of the parts of a workbook that a table needs, unpacked."""
MOST_CELLS = 8_000_000
"""Cells of a sheet: rows times columns up to its last. All rows that a sheet can have, of seven columns, are fewer."""
MEMORY = 5 << 29
"""Bytes that the process that reads a workbook may take, where the system can limit it: so many cells take half."""
NEEDED = re.compile(
    r"\[Content_Types\]\.xml|_rels/.*|xl/(workbook|styles|sharedStrings)\.(xml|bin)|xl/(_rels|worksheets)/.*"
    r"|mimetype|content\.xml|styles\.xml|META-INF/manifest\.xml"
)
"""Parts that hold tables: no pictures, no macros, no links."""

_REFERENCE = re.compile(rb'<(?:\w+:)?(?:c|row)\b[^>]*?\br="([A-Za-z]{0,3})(\d{1,10})"')
_READ = f"""
import io, json, sys
from datetime import date, datetime, time, timedelta
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, ({MEMORY}, {MEMORY}))
except (ImportError, ValueError, OSError):
    pass
try:
    from python_calamine import CalamineWorkbook
except ImportError:
    print("python-calamine is not installed, which reads workbooks: pip install python-calamine")
    sys.exit(3)

def said(value):
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, (int, float)):
        return float(value)
    if isinstance(value, timedelta):
        seconds = value.total_seconds()
        return f"{{int(seconds // 3600)}}:{{int(seconds // 60) % 60:02d}}:{{seconds % 60:09.6f}}"
    return value.isoformat() if isinstance(value, (date, datetime, time)) else str(value)

try:
    book = CalamineWorkbook.from_filelike(io.BytesIO(sys.stdin.buffer.read()))
    for name in book.sheet_names:
        try:
            sheet = book.get_sheet_by_name(name)
        except Exception:
            continue
        if sheet.height * sheet.width > {MOST_CELLS}:
            size = f"{{sheet.height}} rows of {{sheet.width}} columns"
            print(f"sheet {{name!r}} has {{size}}; at most {MOST_CELLS} cells are read")
            sys.exit(3)
        rows = [[said(value) for value in row] for row in sheet.to_python(skip_empty_area=False)]
        sys.stdout.write(json.dumps([name, rows]) + "\\n")
except BaseException as error:
    if isinstance(error, SystemExit):
        raise
    reason = (str(error).strip() or type(error).__name__).splitlines()[0][:120]
    print(f"is no readable workbook, .xlsx, .xlsb, .xls or .ods ({{reason}})")
    sys.exit(3)
"""


def workbook_sheets(path: Path, data: bytes) -> list[Sheet]:
    """The sheets of a workbook, in their order, those of charts left out; an InputError where it cannot be read."""
    if data.startswith(b"PK"):
        data = _repacked(path, data)
    done = subprocess.run([sys.executable, "-I", "-c", _READ], input=data, capture_output=True, check=False)
    lines = done.stdout.decode("utf-8", "replace").splitlines()
    if done.returncode:
        said = lines[-1] if done.returncode == 3 and lines else "is no readable workbook, or too large a one"
        raise InputError(f"{path}: {said}")
    return [Sheet(path, cells=_cells(rows), name=name) for name, rows in map(json.loads, lines)]


def sheet_of_workbook(sheets: list[Sheet], path: Path, name: str) -> Sheet:
    """The sheet of a name; an InputError where there is none."""
    found = next((sheet for sheet in sheets if sheet.name == name), None)
    if found is None:
        raise InputError(f"{path}: sheet {name!r} is not there; {nearest(name, [sheet.name for sheet in sheets])}")
    return found


def _cells(rows: list[list[str | float]]) -> list[list[str]]:
    """Texts of cells; numbers remember that they were such."""
    return [[value if isinstance(value, str) else Typed(repr(value)) for value in row] for row in rows]


def _repacked(path: Path, data: bytes) -> bytes:
    """An archive of the parts that a table needs, none of which is larger than it says, or declares entities."""
    packed = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive, zipfile.ZipFile(packed, "w") as alone:
            members = archive.infolist()
            names = [member.filename for member in members]
            if len(names) > MOST_MEMBERS or len(set(names)) < len(names):
                raise InputError(f"{path}: has more than {MOST_MEMBERS} parts, or one twice; not read")
            needed = [member for member in members if NEEDED.fullmatch(member.filename)]
            for member in needed:
                if ".." in member.filename.split("/") or "\\" in member.filename:
                    raise InputError(f"{path}: part {member.filename!r} would leave the archive; not read")
            if sum(member.file_size for member in needed) > MOST_BYTES:
                raise InputError(f"{path}: unpacks to more than {MOST_BYTES} bytes; not read")
            for member in needed:
                content = archive.read(member)
                _refuse_content(path, member.filename, content)
                alone.writestr(member.filename, content)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError, OSError) as error:
        raise InputError(f"{path}: is no readable workbook ({error})") from error
    return packed.getvalue()


def _refuse_content(path: Path, name: str, content: bytes) -> None:
    """Refuse XML that declares a document type, and a sheet that has cells far away: it would be held whole."""
    if name.endswith(".bin"):
        # cells far away in these meet the limit of memory
        return
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content or content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{path}: {name} declares a DOCTYPE, or is not UTF-8; not read")
    if not name.startswith("xl/worksheets/"):
        return
    rows, columns = 1, 1
    for found in _REFERENCE.finditer(content):
        rows = max(rows, int(found[2]))
        place = 0
        for letter in found[1].upper():
            place = 26 * place + letter - 64
        columns = max(columns, place)
    if rows * columns > MOST_CELLS:
        what = f"{name} has cells up to row {rows} and column {columns}; at most {MOST_CELLS} cells are read"
        raise InputError(f"{path}: {what}")
