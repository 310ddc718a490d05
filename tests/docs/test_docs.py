"""The documentation works: blocks of code run, the site builds strictly and loads nothing from other hosts."""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import pytest

from browser import Window
from doc_blocks import ROOT, Reader, blocks_of, matches
from reference import reference_page

PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md"])
RUNNABLE = [page for page in PAGES if any(block.language != "text" for block in blocks_of(page))]
LONG = ("notebook",)
"""Pages whose blocks take long."""


@pytest.fixture(scope="module")
def records(tmp_path_factory, programs) -> Path:
    """Return a simulated bench, and a record with a secret."""
    folder = tmp_path_factory.mktemp("records")
    page = folder / "page.md"
    page.write_text(
        "```sh\ntrihedron new scenario bench.toml\ntrihedron simulate bench.toml --out run\n"
        "cp run/positions.csv positions.csv\ntrihedron hidden measured.csv --seed 141\n```\n",
        encoding="utf-8",
    )
    Reader(page, folder, folder, programs, long=False).read()
    return folder


@pytest.fixture
def read(tmp_path, records, programs) -> Callable[..., None]:
    """Follow a page, in an empty folder."""

    def read_page(page: Path, *, long: bool) -> None:
        if page.name == "native-fmus.md" and not shutil.which("cc"):
            pytest.skip("no C compiler")
        folder = tmp_path / "reader"
        folder.mkdir()
        Reader(page, folder, records, programs, long=long).read()

    return read_page


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, marks=[pytest.mark.acceptance] if page.stem in LONG else [], id=page.stem)
        for page in RUNNABLE
        if any(not block.acceptance for block in blocks_of(page))
    ],
)
def test_blocks_of_code_do_what_the_page_says(page, read):
    read(page, long=False)


@pytest.mark.acceptance
@pytest.mark.parametrize("page", [p for p in RUNNABLE if any(b.acceptance for b in blocks_of(p))], ids=lambda p: p.stem)
def test_long_blocks_do_what_the_page_says_too(page, read):
    read(page, long=True)


def test_no_code_hides_in_indented_blocks():
    """An indented block would not be run."""
    generated = {"reference.md", "api.md"}
    wrong = []
    for page in PAGES:
        if page.name in generated or page.parent == ROOT:
            continue
        text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
        wrong += [f"{page.name}: {line}" for line in re.findall(r"(?<=\n\n)    \S.*", text)]
    assert wrong == []


def test_output_is_compared_line_by_line():
    assert matches("a\n...\nc\n", "a\nb\nb2\nc\n")
    assert matches("a\n", "a")
    assert not matches("a\n", "a\nb\n")
    assert not matches("a\n...\nc\n", "a\nb\n")


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    if find_spec("material") is None:
        pytest.skip("mkdocs-material is not installed (extra docs)")
    folder = tmp_path_factory.mktemp("site") / "site"
    # With --quiet mkdocs counts no warnings.
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(folder)]
    quick = {**os.environ, "TRIHEDRON_SITE": "quick"}
    process = subprocess.run(command, cwd=ROOT, env=quick, capture_output=True, text=True, check=False)
    assert process.returncode == 0, process.stdout + process.stderr
    return folder


@pytest.mark.acceptance
def test_the_site_builds_strictly_with_every_page(site):
    missing = [page.stem for page in PAGES if page.parent != ROOT and not (site / f"{page.stem}.html").is_file()]
    assert missing == []


@pytest.mark.acceptance
def test_every_page_is_in_the_navigation(site):
    home = (site / "index.html").read_text(encoding="utf-8")
    nav = home[home.index("md-nav--primary") :]
    missing = [p.stem for p in PAGES if p.parent != ROOT and p.stem != "index" and f'href="{p.stem}.html"' not in nav]
    assert missing == []


@pytest.mark.acceptance
def test_the_site_asks_nothing_of_the_network(site):
    options = []
    for page in site.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        options += re.findall(r'<(?:script|img|iframe|source)[^>]*\bsrc="(?:https?:)?//[^"]*"', text)
        options += [
            tag for tag in re.findall(r'<link[^>]*href="(?:https?:)?//[^"]*"[^>]*>', text) if "canonical" not in tag
        ]
    for sheet in site.rglob("*.css"):
        options += re.findall(
            r"(?:url\(|@import\s+[\"'])\s*[\"']?(?:https?:)?//[^)\"']*", sheet.read_text(encoding="utf-8")
        )
    assert options == []


@pytest.mark.acceptance
def test_pages_of_the_site_open_in_a_browser_from_the_disk(site, window: Window):
    for name in ("index", "tutorial", "falsified", "commands", "reference"):
        for width in (1280, 400):
            observed = window.open(site / f"{name}.html", width)
            assert (observed["scroll"], observed["outside"], observed["images"]) == (width, [], []), (
                f"{name} at {width}"
            )
    assert window.complaints == []


@pytest.mark.acceptance
def test_the_site_is_searched_from_the_disk_and_read_from_page_to_page(site, window: Window):
    window.open(site / "index.html", 1280)
    window.page.click("[data-md-component=search-query]")
    window.page.keyboard.type("hysteresis", delay=20)
    result = window.page.locator(".md-search-result__link").first
    result.wait_for()
    result.click()
    window.page.wait_for_load_state()
    assert "hysteresis" in window.page.inner_text("body").lower()
    window.open(site / "index.html", 1280)
    window.page.click(".md-footer__link--next")
    window.page.wait_for_load_state()
    assert window.page.url.endswith("tutorial.html")
    assert window.complaints == []


def test_every_field_of_every_result_has_its_line_and_the_gallery_its_pages(site):
    from site_pages import result_classes

    library = (site / "api.html").read_text(encoding="utf-8")
    for kind in result_classes():
        assert f'<h3 id="{kind.__name__.lower()}' in library, kind
        keys = [field.alias or name for name, field in kind.model_fields.items() if not field.exclude]
        assert [key for key in keys if f"<code>{key}</code>" not in library] == [], kind
        # A named file does not exist for the page before its use.
        assert "ForwardRef" not in repr(kind.model_fields), kind
    assert len(result_classes()) > 40
    assert "Insufficient" in (site / "gallery" / "calibrate-insufficient.html").read_text(encoding="utf-8")


@pytest.mark.acceptance
def test_every_page_of_the_gallery_has_its_verdict_and_the_notebook_what_its_cells_show():
    import gallery
    import notebooks

    drawn = {**dict(gallery.pages())}
    assert len(drawn) == len(gallery.SAID)
    assert all(name in gallery.gallery_page() for name in drawn)
    page = notebooks.page_of(ROOT / "docs" / "first-look.ipynb")
    assert page.count("<img ") == 2
    assert "Same: bench and bench" in page


def test_every_command_answers_a_question():
    from trihedron.tools.cli import app

    table = (ROOT / "docs" / "command-line.md").read_text(encoding="utf-8").partition("## Templates")[0]
    documented = {word for cell in re.findall(r"`([^`]+)`", table) for word in cell.split()}
    assert [name for name in app if not name.startswith("-") and name not in documented] == []


def test_commands_and_library_are_described_from_the_code(site):
    from trihedron import __all__
    from trihedron.fmus import components
    from trihedron.tools.cli import app

    commands = (site / "commands.html").read_text(encoding="utf-8")
    missing = [name for name in app if not name.startswith("-") and f'<h2 id="{name}">' not in commands]
    assert missing == []
    assert "--noise-bound" in commands
    described = (site / "components.html").read_text(encoding="utf-8")
    assert [name for name in components() if f'<h2 id="{name.lower()}">' not in described] == []
    assert "dip of the outer axis below the horizon" in described
    library = (site / "api.html").read_text(encoding="utf-8")
    assert [name for name in __all__ if not name.startswith("__") and f">th.{name}<" not in library] == []


def test_the_reference_page_is_what_the_source_says():
    assert (ROOT / "docs" / "reference.md").read_text(encoding="utf-8") == reference_page(), "run `make docs`"


def test_links_in_the_readme_and_the_changelog_lead_somewhere():
    for name in ("README.md", "CHANGELOG.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        links = [link.split("#")[0] for link in re.findall(r"\]\(([^)]+)\)", text) if "://" not in link]
        links += re.findall(r"\bdocs/[\w-]+\.md\b", text)
        assert [link for link in links if link and not (ROOT / link).exists()] == []
