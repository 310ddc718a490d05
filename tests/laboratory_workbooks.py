"""Excel workbooks as laboratories write them, by two libraries that only write."""

import io
from collections.abc import Sequence
from datetime import timedelta

import numpy as np
import xlsxwriter
import xlwt

from laboratory_files import GERMAN, PLAIN, START, Bench, G, LabFile, bench_columns, table

HEAD = (("Calibration of the block", ""), ("Serial number", "A-0017"), ("Operator", "Ann Lee"), ("", ""))
KEPT = {"Serial number": "A-0017", "Operator": "Ann Lee"}
Cells = Sequence[Sequence[object]]


def rows_of(bench: Bench, scale: float = 1.0) -> Cells:
    """Number, time, angles and readings (times `scale`) as numbers."""
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
    """A workbook of the new kind; what is a datetime is a date cell."""
    kept = io.BytesIO()
    book = xlsxwriter.Workbook(kept, {"in_memory": True, "default_date_format": "dd.mm.yyyy hh:mm:ss"})
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
    return kept.getvalue()


def xls(sheets: dict[str, Cells]) -> bytes:
    """A workbook of the old kind."""
    book = xlwt.Workbook()
    dated = xlwt.easyxf(num_format_str="DD.MM.YYYY HH:MM:SS")
    for name, rows in sheets.items():
        sheet = book.add_sheet(name)
        for k, row in enumerate(rows):
            for j, value in enumerate(row):
                sheet.write(k, j, value, *([dated] if hasattr(value, "year") else []))
    kept = io.BytesIO()
    book.save(kept)
    return kept.getvalue()


def workbook_files(bench: Bench) -> list[LabFile]:
    """Workbooks of a position record."""
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
        LabFile("xls with a head", xls({"Data": titled}), suffix=".xls", keeps=KEPT),
        LabFile("xls, dates", xls({"Data": [times, *dated]}), suffix=".xls"),
        LabFile("xls that is text", tab, suffix=".xls"),
    ]
