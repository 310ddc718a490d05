"""A page as PDF, by a browser that is installed: Chromium, Chrome or Edge, without a window."""

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from ..errors import InputError
from ..files import ordinary_file, whole_file, write_text

CONVERTERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
"""Programs that print a page to PDF, the first that is found."""

SECONDS = 120.0
OPTIONS = (
    "--headless",
    "--disable-gpu",
    "--disable-extensions",
    "--disable-background-networking",
    "--no-first-run",
    "--no-pdf-header-footer",
)


def converter() -> str | None:
    """The program that makes PDF on this machine; None where there is none."""
    return next((found for name in CONVERTERS if (found := shutil.which(name))), None)


def report_file(_: object, path: Path | None) -> None:
    """Check the name of a report before anything is computed.

    Raises
    ------
    InputError
        for a device or a pipe, and for .pdf where nothing makes one
    """
    ordinary_file(None, path)
    if path is not None and path.suffix.lower() == ".pdf" and converter() is None:
        raise InputError(
            f"--report {path}: no program here makes PDF (Chromium, Chrome or Edge); give a name in .html and print it"
        )


def write_html(path: Path, page: str) -> None:
    """Write a page as HTML, or as PDF where the name ends so; whole or not at all.

    Raises
    ------
    InputError
        where the file cannot be written, or the page not be printed
    """
    if path.suffix.lower() != ".pdf":
        write_text(path, page)
        return
    program = converter()
    if program is None:
        report_file(None, path)
        return
    # The browser's helpers may still write into its profile when it has ended: what they leave is not our fault.
    scratch = tempfile.TemporaryDirectory(prefix="trihedron-", ignore_cleanup_errors=True)
    with scratch as folder, whole_file(path) as beside:
        source, made = Path(folder) / "page.html", Path(folder) / "page.pdf"
        source.write_text(page, encoding="utf-8", newline="\n")
        _print(program, source, made, path)
        beside.write_bytes(without_times(made.read_bytes()))


def _print(program: str, source: Path, made: Path, path: Path) -> None:
    command = [program, *OPTIONS, f"--user-data-dir={source.parent / 'profile'}", f"--print-to-pdf={made}"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        # A browser does not run for the superuser within its sandbox; the page has no script and is ours.
        command.append("--no-sandbox")
    try:
        done = subprocess.run(
            [*command, source.as_uri()], capture_output=True, timeout=SECONDS, stdin=subprocess.DEVNULL, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(f"{path}: {Path(program).name} did not print it; give a name in .html") from error
    if done.returncode != 0 or not made.is_file() or not made.read_bytes().startswith(b"%PDF"):
        raise InputError(f"{path}: {Path(program).name} did not print it; give a name in .html")


def without_times(content: bytes) -> bytes:
    """A PDF whose times of making are all the same, so that the same page gives the same bytes."""
    return re.sub(rb"(?<=Date \(D:)\d{14}", b"20000101000000", content)
