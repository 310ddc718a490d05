"""Workbooks as laboratories write them: .xlsx and .xls by write-only libraries, .xlsb and .ods byte by byte."""

import io
import struct
import zipfile
from collections.abc import Sequence
from datetime import datetime, timedelta
from xml.sax.saxutils import escape

import numpy as np
import xlsxwriter
import xlwt

from laboratory_files import GERMAN, PLAIN, START, Bench, G, LabFile, bench_columns, table

HEAD = (("Calibration of the block", ""), ("Serial number", "A-0017"), ("Operator", "Ann Lee"), ("", ""))
KEPT = {"Serial number": "A-0017", "Operator": "Ann Lee"}
Cells = Sequence[Sequence[object]]


def rows_of(bench: Bench, scale: float = 1.0) -> Cells:
    """Return number, time, angles and readings (times `scale`) as numbers."""
    return [
        [
            k + 1,
            float(bench.time[k]),
            float(bench.alpha[k]),
            float(bench.beta[k]),
            *(float(v * scale) for v in bench.force[k]),
        ]
        for k in range(len(bench.time))
    ]


def xlsx(sheets: dict[str, Cells], *, chart: bool = False) -> bytes:
    """Return a workbook of the new kind; a datetime becomes a date cell."""
    stream = io.BytesIO()
    book = xlsxwriter.Workbook(stream, {"in_memory": True, "default_date_format": "dd.mm.yyyy hh:mm:ss"})
    for name, rows in sheets.items():
        sheet = book.add_worksheet(name)
        for k, row in enumerate(rows):
            sheet.write_row(k, 0, row)
    if chart:
        drawn = book.add_chart({"type": "line"})
        assert drawn is not None
        drawn.add_series({"values": f"={next(iter(sheets))}!$E$6:$E$9"})
        book.add_chartsheet("Chart").set_chart(drawn)
    book.close()
    return stream.getvalue()


def xls(sheets: dict[str, Cells]) -> bytes:
    """Return a workbook of the old kind."""
    book = xlwt.Workbook()
    dated = xlwt.easyxf(num_format_str="DD.MM.YYYY HH:MM:SS")
    for name, rows in sheets.items():
        sheet = book.add_sheet(name)
        for k, row in enumerate(rows):
            for j, value in enumerate(row):
                sheet.write(k, j, value, *([dated] if hasattr(value, "year") else []))
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def _part(kind: int, content: bytes = b"") -> bytes:
    """Return a record of the binary format: its kind and length seven bits at a time, lowest first."""
    head = bytes([kind]) if kind < 128 else bytes([kind & 0x7F | 0x80, kind >> 7])
    length, size = len(content), b""
    while length > 127:
        size, length = size + bytes([length & 0x7F | 0x80]), length >> 7
    return head + size + bytes([length]) + content


def _wide(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode("utf-16-le")


def _binary_sheet(rows: Cells) -> bytes:
    parts = _part(129) + _part(148, struct.pack("<4I", 0, len(rows) - 1, 0, max(map(len, rows)) - 1)) + _part(145)
    for k, row in enumerate(rows):
        parts += _part(0, struct.pack("<IIHBBBI", k, 0, 300, 0, 0, 0, 0))
        for j, value in enumerate(row):
            cell = struct.pack("<II", j, 0)
            number = isinstance(value, int | float)
            parts += _part(5, cell + struct.pack("<d", value)) if number else _part(6, cell + _wide(str(value)))
    return parts + _part(146) + _part(130)


def xlsb(sheets: dict[str, Cells]) -> bytes:
    """Return a workbook of the binary kind, numbers and texts."""
    stream = io.BytesIO()
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    related = f'<Relationships xmlns="{package}/relationships">{{}}</Relationships>'
    relation = f'<Relationship Id="rId{{0}}" Type="{office}/{{1}}" Target="{{2}}"/>'
    kind = "application/vnd.ms-excel.sheet.binary.macroEnabled.main"
    types = f'<Types xmlns="{package}/content-types"><Default Extension="bin" ContentType="{kind}"/></Types>'
    names = b"".join(
        _part(156, struct.pack("<II", 0, k) + _wide(f"rId{k}") + _wide(name)) for k, name in enumerate(sheets, 1)
    )
    with zipfile.ZipFile(stream, "w") as made:
        made.writestr("[Content_Types].xml", types)
        made.writestr("_rels/.rels", related.format(relation.format(1, "officeDocument", "xl/workbook.bin")))
        parts = [relation.format(k, "worksheet", f"worksheets/sheet{k}.bin") for k in range(1, len(sheets) + 1)]
        made.writestr("xl/_rels/workbook.bin.rels", related.format("".join(parts)))
        made.writestr("xl/workbook.bin", _part(131) + _part(143) + names + _part(144) + _part(132))
        for k, rows in enumerate(sheets.values(), 1):
            made.writestr(f"xl/worksheets/sheet{k}.bin", _binary_sheet(rows))
    return stream.getvalue()


def _open_cell(value: object) -> str:
    if isinstance(value, int | float):
        kind, text = f'float" office:value="{value!r}', f"{value:.2f}"
    elif isinstance(value, datetime):
        kind, text = f'date" office:date-value="{value.isoformat()}', "a day"
    else:
        kind, text = "string", escape(str(value))
    return f'<table:table-cell office:value-type="{kind}"><text:p>{text}</text:p></table:table-cell>'


def ods(sheets: dict[str, Cells]) -> bytes:
    """Return a workbook of LibreOffice, with its empty cells up to the sheet's end."""
    space = "urn:oasis:names:tc:opendocument:xmlns:"
    end = '<table:table-row table:number-rows-repeated="{}"><table:table-cell table:number-columns-repeated="16384"/>'
    tables = ""
    for name, rows in sheets.items():
        cells = "".join(f"<table:table-row>{''.join(map(_open_cell, row))}</table:table-row>" for row in rows)
        tables += f'<table:table table:name="{name}">{cells}{end.format((1 << 20) - len(rows))}</table:table-row>'
        tables += "</table:table>"
    names = " ".join(f'xmlns:{name}="{space}{name}:1.0"' for name in ("office", "table", "text"))
    body = f"<office:body><office:spreadsheet>{tables}</office:spreadsheet></office:body>"
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as parts:
        parts.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        parts.writestr("content.xml", f"<office:document-content {names}>{body}</office:document-content>")
        parts.writestr("META-INF/manifest.xml", f'<manifest:manifest xmlns:manifest="{space}manifest:1.0"/>')
    return stream.getvalue()


def workbook_files(bench: Bench) -> list[LabFile]:
    """Return workbooks of a position record."""
    head: Cells = [list(row) for row in HEAD]
    plain, in_mg = rows_of(bench), rows_of(bench, 1e3 / G)
    titled = [*head, list(PLAIN), *plain]
    mg = ["Nr", "Zeit", "alpha", "beta", "ax", "ay", "az"]
    units = ["", "s", "°", "°", "mg", "mg", "mg"]
    dated = [[row[0], START + timedelta(seconds=float(bench.time[k])), *row[2:]] for k, row in enumerate(plain)]
    times = ["No", "Timestamp", *PLAIN[2:]]
    german = bench_columns(bench, scale=1.0 / G, decimals=11, mark=",")
    texts: Cells = [list(row) for row in zip(*german, strict=True)]
    holes = [list(row) for row in plain]
    holes[3][4], holes[7][6] = "#N/A", ""
    keep = np.array([k for k in range(len(plain)) if k not in (3, 7)])
    tab = table(GERMAN, german, sep="\t", encoding="cp1252", end="\r\n")
    return [
        LabFile("xlsx with a head", xlsx({"Data": titled}), suffix=".xlsx", keeps=KEPT),
        LabFile("xlsx, row of units", xlsx({"Daten": [mg, units, *in_mg]}), suffix=".xlsx"),
        LabFile("xlsx, dates", xlsx({"Data": [times, *dated]}), suffix=".xlsx"),
        LabFile("xlsx, numbers as texts", xlsx({"Data": [list(GERMAN), *texts]}), suffix=".xlsx"),
        LabFile(
            "xlsx, empty sheet and chart", xlsx({"Data": titled, "Empty": []}, chart=True), suffix=".xlsx", keeps=KEPT
        ),
        LabFile(
            "xlsx, two tables",
            xlsx({"Run 1": titled, "Run 2": titled}),
            needs={"sheet": "Run 2"},
            suffix=".xlsx",
        ),
        LabFile(
            "xlsx, no unit",
            xlsx({"Data": [mg[:1] + list(PLAIN[1:4]) + mg[4:], *in_mg]}),
            needs={"units.force": "mg"},
            suffix=".xlsx",
        ),
        LabFile("xlsx, cells missing", xlsx({"Data": [list(PLAIN), *holes]}), suffix=".xlsx", rows=keep),
        LabFile("xlsb with a head", xlsb({"Data": titled}), suffix=".xlsb", keeps=KEPT),
        LabFile("xlsb, two tables", xlsb({"A": titled, "B": titled}), needs={"sheet": "B"}, suffix=".xlsb"),
        LabFile("ods with a head", ods({"Data": titled}), suffix=".ods", keeps=KEPT),
        LabFile("ods, dates", ods({"Info": [["x", 1.0]], "Data": [times, *dated]}), suffix=".ods"),
        LabFile("xls with a head", xls({"Data": titled}), suffix=".xls", keeps=KEPT),
        LabFile("xls, dates", xls({"Data": [times, *dated]}), suffix=".xls"),
        LabFile("xls that is text", tab, suffix=".xls"),
    ]
