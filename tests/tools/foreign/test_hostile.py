"""Any content of a file gives a record, or one line with the reason; never a traceback, never half a record."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import trihedron as th

ROWS = [f"{k};{10 * k},0;{20 * k},0;{30 * k},0;{0.1 * k:.4f};0,2;0,9".replace(".", ",").encode() for k in range(1, 9)]
NAMES = "Nr;Zeit [s];alpha [°];beta [°];ax [g];ay [g];az [g]".encode("cp1252")
CELLS = (
    "|1,234|1.234|1.234,5|1e400|-1e-400|NaN|inf|١٢|−5|12°34'56\"|99:99:99|01.02.2026|2026-02-30|0x1F|1_0|'|\"|=1+1|½|²|\x00"
    "|\ud7ff|1e5|+|-|.|,|1 000|1'000'000|10:15|10:15:61|\u200b1|9999999999999999999999|0,9 g|0,9 mg|5 °|a;b|#NV"
)
KEYS = (
    "kind decimal thousands dates clock readings names units_row first last time missing attitude encoding separator"
    " sheet units.force units.angle units.time units.nothing columns.f1_mps2 columns.f1_mps2.sign columns.x schema"
    " columns.alpha_deg.from columns.alpha_deg.unit units columns incomplete kind.x columns.f1_mps2.offset"
)
VALUES = "?| |.|,|-1|0|99|g|1/0 g|0.5 g/V|V|degC|none|utf-16|ax [g]|1e999"
words = st.text(max_size=30)
cells = st.one_of(st.sampled_from(CELLS.split("|")), words)
keys, values = st.sampled_from(KEYS.split()), st.one_of(st.sampled_from(VALUES.split("|")), words)
SETTINGS = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
)


def line(key: str, value: str) -> str:
    """Return a line of a mapping."""
    return f'{key} = "{value}"'


def refusal(*arguments: object, **options: object) -> str:
    """Return the refusal of an import, in one line; "" if there is none."""
    try:
        th.import_record(*arguments, **options)  # type: ignore[arg-type]
    except th.InputError as error:
        message = str(error)
        return message if message.splitlines() == [message] else f"several lines: {message!r}"
    return ""


def imported(folder: Path, content: bytes, answers: dict[str, str] | None = None, name: str = "lab.csv") -> None:
    """Import bytes; a refusal is one line, and a record can be read."""
    path, out = folder / name, folder / "record.csv"
    path.write_bytes(content)
    for file in folder.glob("record*"):
        file.unlink()
    message = refusal(path, out=out, answers=answers)
    assert not message.startswith("several lines")
    assert out.exists() == (not message)
    if not message:
        assert np.isfinite(th.read_record(out).specific_force).all()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("hostile")


@SETTINGS
@given(content=st.binary(max_size=400), at=st.integers(0, 300))
def test_random_bytes_anywhere(folder: Path, content: bytes, at: int):
    table = b"\r\n".join([NAMES, *ROWS])
    imported(folder, content)
    imported(folder, table[:at] + content + table[at:])


@pytest.mark.acceptance
@SETTINGS
@given(row=st.integers(0, 8), column=st.integers(0, 6), cell=cells, sep=st.sampled_from([b";", b"\t"]))
def test_a_wrong_cell_anywhere(folder: Path, row: int, column: int, cell: str, sep: bytes):
    lines = [NAMES, *ROWS]
    fields = lines[row].split(b";")
    fields[column] = cell.encode("utf-8", "surrogatepass")
    lines[row] = b";".join(fields)
    imported(folder, b"\n".join(lines).replace(b";", sep))


@pytest.mark.acceptance
@SETTINGS
@given(rows=st.lists(st.lists(cells, max_size=9), max_size=12), sep=st.sampled_from(";\t, |"))
def test_tables_of_anything(folder: Path, rows: list[list[str]], sep: str):
    text = "\n".join(sep.join(row) for row in rows)
    imported(folder, text.encode("utf-8", "surrogatepass"))
    imported(folder, b"\n".join([NAMES, text.encode("utf-8", "surrogatepass"), *ROWS]))


@pytest.mark.acceptance
@SETTINGS
@given(answers=st.dictionaries(keys, values, max_size=3))
def test_answers_of_any_kind(folder: Path, answers: dict[str, str]):
    imported(folder, b"\n".join([NAMES, *ROWS]), answers)


@pytest.mark.parametrize("key", ["last", "first", "names", "units_row"])
def test_lines_that_are_none_are_refused(folder: Path, key: str):
    path = folder / "lab.csv"
    path.write_bytes(b"\n".join([NAMES, *ROWS]))
    assert f"--set {key}=-5" in refusal(path, answers={key: "-5"})


@pytest.mark.acceptance
@SETTINGS
@given(
    lines=st.lists(
        st.one_of(words, st.sampled_from(["[columns]", "[units]"]), st.builds(line, keys, values)), max_size=8
    )
)
def test_mappings_of_anything(folder: Path, lines: list[str]):
    mapping, path = folder / "any.toml", folder / "lab.csv"
    mapping.write_text('schema = "trihedron.mapping/1"\n' + "\n".join(lines), encoding="utf-8", errors="replace")
    path.write_bytes(b"\n".join([NAMES, *ROWS]))
    assert not refusal(path, mapping=mapping).startswith("several lines")


@pytest.mark.acceptance
@settings(SETTINGS, max_examples=20)
@given(content=st.binary(min_size=1, max_size=40), at=st.floats(0.0, 1.0), old=st.booleans())
def test_workbooks_with_wrong_bytes(folder: Path, content: bytes, at: float, old: bool):
    pytest.importorskip("python_calamine", reason="python-calamine is not installed")
    pytest.importorskip("xlwt", reason="xlwt is not installed")
    pytest.importorskip("xlsxwriter", reason="xlsxwriter is not installed")
    from laboratory_workbooks import xls, xlsx

    table = (xls if old else xlsx)(
        {"Data": [NAMES.decode("cp1252").split(";"), *([float(k)] * 7 for k in range(1, 9))]}
    )
    place = 8 + int(at * (len(table) - 8))
    imported(folder, table[:place] + content + table[place + len(content) :], name="lab.xls")


def test_the_clean_file_of_these_tests_is_imported(folder: Path):
    imported(folder, b"\n".join([NAMES, *ROWS]))
    assert (folder / "record.csv").exists()
