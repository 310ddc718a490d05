"""Read workbooks in another process: a corrupt or malicious one may crash its library, calamine (in Rust)."""

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
"""Largest number of parts of a workbook."""
MOST_BYTES = 400_000_000
"""Largest unpacked size of the needed parts of a workbook [bytes]."""
MOST_CELLS = 8_000_000
"""Largest number of cells of a sheet (rows times columns up to its last): enough for a full sheet of seven columns."""
MEMORY = 5 << 29
"""Memory limit of the process that reads a workbook [bytes], if the system supports one: twice the need of such a
sheet."""
LONGEST_READ = 120
"""Limit of the processor's time of that process [s]: on a damaged file, a library may never end."""
NEEDED = re.compile(
    r"\[Content_Types\]\.xml|_rels/.*|xl/(workbook|styles|sharedStrings)\.(xml|bin)|xl/(_rels|worksheets)/.*"
    r"|mimetype|content\.xml|styles\.xml|META-INF/manifest\.xml"
)
"""Parts that hold tables: no pictures, no macros, no links."""
_REFERENCE = re.compile(rb'<(?:\w+:)?(?:c|row)\b[^>]*?\br="([A-Za-z]{0,3})(\d{1,10})"')
_LIMITED = f"""
import io, json, sys
try:
    import resource
    resource.setrlimit(resource.RLIMIT_AS, ({MEMORY}, {MEMORY}))
    resource.setrlimit(resource.RLIMIT_CPU, ({LONGEST_READ}, {LONGEST_READ}))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
except (ImportError, ValueError, OSError):
    pass
"""
"""First lines of a programme that reads a file: it gets no more memory than tables take."""
_RUN = """
import runpy
sys.argv.pop(0)
runpy.run_path(sys.argv[0], run_name="__main__")
"""
_READ = f"""
from datetime import date, datetime, time, timedelta
try:
    from python_calamine import CalamineWorkbook
except ImportError:
    print("python-calamine is not installed, which reads workbooks: pip install python-calamine")
    sys.exit(3)

def text_of(value):
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
        rows = [[text_of(value) for value in row] for row in sheet.to_python(skip_empty_area=False)]
        sys.stdout.write(json.dumps([name, rows]) + "\\n")
except BaseException as error:
    if isinstance(error, SystemExit):
        raise
    reason = (str(error).strip() or type(error).__name__).splitlines()[0][:120]
    print(f"is not a readable workbook, .xlsx, .xlsb, .xls or .ods ({{reason}})")
    sys.exit(3)
"""


def workbook_sheets(path: Path, content: bytes) -> list[Sheet]:
    """Return the sheets of a workbook in order, without charts.

    Raises InputError if it cannot be read.
    """
    if content.startswith(b"PK"):
        content = _repacked(path, content)
    try:
        lines = output_of_reader(_READ, content=content).decode("utf-8", "replace").splitlines()
    except ValueError as error:
        raise InputError(f"{path}: {str(error) or 'is not a readable workbook, or is too large'}") from error
    return [Sheet(path, cells=_cells(rows), name=name) for name, rows in map(json.loads, lines)]


def output_of_reader(programme: str | Path, *arguments: str, content: bytes = b"") -> bytes:
    """Return the output of a programme that reads a file in another process, with limited memory.

    Raises ValueError if it fails, with the last line of its output for status 3.
    """
    if isinstance(programme, Path):
        programme, arguments = _RUN, (str(programme), *arguments)
    command = [sys.executable, "-I", "-c", _LIMITED + programme, *arguments]
    reader = subprocess.run(command, input=content, capture_output=True, check=False)
    if reader.returncode == 3:
        lines = reader.stdout.decode("utf-8", "replace").splitlines()
        raise ValueError(lines[-1] if lines else "")
    if reader.returncode:
        raise ValueError
    return reader.stdout


def names_of(sheets: list[Sheet]) -> list[str]:
    """Return the names of a workbook's sheets."""
    return [sheet.name for sheet in sheets]


def sheet_of_workbook(sheets: list[Sheet], path: Path, name: str) -> Sheet:
    """Return the sheet of a name.

    Raises InputError if there is none.
    """
    names = names_of(sheets)
    if name not in names:
        raise InputError(f"{path}: sheet {name!r} is not there; {nearest(name, names)}")
    return sheets[names.index(name)]


def _cells(rows: list[list[str | float]]) -> list[list[str]]:
    """Return the texts of cells; numbers remain marked as numbers."""
    cells: list[list[str]] = []
    for row in rows:
        cells.append([value if isinstance(value, str) else Typed(repr(value)) for value in row])
    return cells


def _repacked(path: Path, archive_bytes: bytes) -> bytes:
    """Return an archive of the parts that a table needs; refuse parts of a false size or with entities."""
    packed = io.BytesIO()
    try:
        with zipfile.ZipFile(io.BytesIO(archive_bytes)) as archive, zipfile.ZipFile(packed, "w") as alone:
            members = archive.infolist()
            names = [member.filename for member in members]
            if len(names) > MOST_MEMBERS or len(set(names)) < len(names):
                raise InputError(f"{path}: has more than {MOST_MEMBERS} parts, or one twice; not read")
            needed = []
            for member in members:
                if NEEDED.fullmatch(member.filename):
                    needed.append(member)
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
        raise InputError(f"{path}: is not a readable workbook ({error})") from error
    return packed.getvalue()


def _refuse_content(path: Path, name: str, content: bytes) -> None:
    """Refuse XML that declares a document type, and a sheet with remote cells: it would be held whole."""
    if name.endswith(".bin"):
        # for these, remote cells meet the limit of memory
        return
    if b"<!DOCTYPE" in content or b"<!ENTITY" in content or content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise InputError(f"{path}: {name} declares a DOCTYPE, or is not UTF-8; not read")
    if not name.startswith("xl/worksheets/"):
        return
    rows, columns = 1, 1
    for reference in _REFERENCE.finditer(content):
        rows = max(rows, int(reference[2]))
        place = 0
        for letter in reference[1].upper():
            place = 26 * place + letter - 64
        columns = max(columns, place)
    if rows * columns > MOST_CELLS:
        what = f"{name} has cells up to row {rows} and column {columns}; at most {MOST_CELLS} cells are read"
        raise InputError(f"{path}: {what}")
