"""Make the README's pictures: a terminal and a page of a record of the gallery. Needs Playwright and Chromium.

python docs/builders/screens.py docs
"""

import io
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from playwright.sync_api import sync_playwright
from rich.console import Console
from rich.terminal_theme import MONOKAI
from rich.text import Text

RECORD = "explained.csv"
COMMAND = f"trihedron diagnose {RECORD} --noise-bound 1e-5 --report diagnosis.html"
LETTERS = 118
SCREEN = {"width": 1100, "height": 980}


def terminal(output: str) -> str:
    """Return the output of a command as a terminal shows it; SVG without external fonts."""
    console = Console(width=LETTERS, record=True, file=io.StringIO(), force_terminal=True)
    console.print(Text(f"$ {COMMAND}", style="bold"))
    console.print(Text(output.rstrip(), overflow="fold"))
    svg = console.export_svg(title="Terminal", theme=MONOKAI, unique_id="terminal")
    return re.sub(r"@font-face \{.*?\}\s*", "", svg, flags=re.DOTALL).replace("Fira Code", "DejaVu Sans Mono")


def screen(page: Path) -> bytes:
    """Return the first screen of a page, PNG."""
    program = shutil.which("chromium") or shutil.which("chrome") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=["--no-sandbox"])
        window = browser.new_page(viewport=SCREEN)  # type: ignore[arg-type]
        window.goto(page.as_uri())
        picture = window.screenshot()
        browser.close()
    return picture


def main(docs: Path) -> None:
    """Write both into `pictures`."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        shutil.copy(docs / "gallery" / RECORD, folder)
        command = [sys.executable, "-m", "trihedron.tools.cli", *COMMAND.split()[1:]]
        process = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)
        (docs / "pictures" / "terminal.svg").write_text(terminal(process.stdout), encoding="utf-8")
        (docs / "pictures" / "page.png").write_bytes(screen(folder / "diagnosis.html"))


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
