"""The pages that are made from the source are up to date."""

from pathlib import Path

from reference import reference_page

ROOT = Path(__file__).resolve().parents[2]


def test_the_reference_page_is_what_the_source_says():
    assert (ROOT / "docs" / "reference.md").read_text(encoding="utf-8") == reference_page(), "run `make docs`"


def test_the_files_that_the_readme_links_to_exist():
    import re

    text = (ROOT / "README.md").read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []
