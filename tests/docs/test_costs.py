"""Measured costs stand in tables of the page that `make bench` writes."""

import re
from pathlib import Path

import pytest

from costs import PAGE, with_row

ROOT = Path(__file__).resolve().parents[2]
PAGE_TEXT = "Before\n<!-- many -->\n| work | ms |\n|---|---|\n| a | 1 |\n<!-- end of many -->\nafter | a | 1 |\n"


def test_a_row_is_replaced_or_added_in_its_table_alone():
    replaced = with_row(PAGE_TEXT, "many", "a", "2")
    assert replaced == PAGE_TEXT.replace("| a | 1 |\n<!--", "| a | 2 |\n<!--")
    added = with_row(replaced, "many", "b", "3")
    assert added == replaced.replace("<!-- end", "| b | 3 |\n<!-- end")
    assert with_row(added, "many", "b", "3") == added


def test_a_table_that_the_page_has_not_is_refused():
    with pytest.raises(ValueError, match="substring not found"):
        with_row(PAGE_TEXT, "few", "a", "2")


def test_the_page_has_each_table_of_the_benchmarks():
    page = (ROOT / "docs" / PAGE).read_text(encoding="utf-8")
    tables = set()
    for path in (ROOT / "tests" / "benchmarks").glob("test_*.py"):
        tables.update(re.findall(r'cost_row\("([a-z]+)"', path.read_text(encoding="utf-8")))
    assert tables
    for table in tables:
        assert with_row(page, table, "a row", "1") != page
