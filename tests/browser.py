"""A real browser without a window (Playwright on an installed Chromium): the look of a page, and its errors."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Page, Request

PROGRAMS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
QUIET = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-dev-shm-usage",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--no-first-run",
    "--force-color-profile=srgb",
)
HERE = ("file:", "data:", "about:", "blob:", "http://127.0.0.1:", "http://localhost:")
"""Addresses of this machine."""

MEASURE = """(() => {
  const wide = document.documentElement.clientWidth;
  const scrolls = e => { for (e = e.parentElement; e; e = e.parentElement)
    if (getComputedStyle(e).overflowX !== 'visible') return true; return false; };
  const out = [...document.body.querySelectorAll('*')].filter(e => {
    const box = e.getBoundingClientRect();
    return box.width > 0 && (box.right > wide + 1 || box.left < -1) && !scrolls(e) && !e.closest('svg');
  });
  return {
    client: wide,
    scroll: document.documentElement.scrollWidth,
    outside: out.map(e => e.tagName + ' ' + e.className),
    images: [...document.images].filter(i => !(i.complete && i.naturalWidth)).map(i => i.src),
    pictures: [...document.querySelectorAll('svg, math')].map(s => s.getBoundingClientRect())
      .map(box => [box.width, box.height]),
    height: document.documentElement.scrollHeight,
    text: document.body.innerText,
  };
})()"""


class Window:
    """A page in a browser.

    Attributes
    ----------
    page : playwright.sync_api.Page
        to click and type in, and to print
    complaints : list of str
        errors and warnings of the console, and addresses that could not be loaded or are not of this machine
    """

    def __init__(self, page: Page) -> None:
        self.page = page
        self.complaints: list[str] = []
        self._requests: list[Request] = []
        self._is_leaving = False
        self._of_pages_before: set[Request] = set()
        page.on("console", self._said)
        page.on("pageerror", lambda error: self.complaints.append(str(error)))
        page.on("request", self._asked)
        page.on("requestfailed", self._failed)

    def _said(self, message: ConsoleMessage) -> None:
        if message.type in ("error", "warning", "assert"):
            self.complaints.append(message.text)

    def _asked(self, request: Request) -> None:
        self._requests.append(request)
        if not request.url.startswith(HERE):
            self.complaints.append(f"asks the network for {request.url}")

    def _failed(self, request: Request) -> None:
        """Complain, unless the window has left the page that asked: that cancels its requests."""
        was_left = self._is_leaving or request in self._of_pages_before
        if not (was_left and request.failure == "net::ERR_ABORTED"):
            self.complaints.append(f"could not load {request.url}")

    def _leave(self) -> None:
        """Leave the page, so that its requests are known before the next one asks."""
        self._is_leaving = True
        self.page.goto("about:blank")
        self._is_leaving = False
        self._of_pages_before.update(self._requests)

    def open(self, page: Path | str, width: int, *, dark: bool = False, printed: bool = False) -> dict[str, Any]:
        """Load a file or an address at a width, in px, and measure it."""
        self.page.set_viewport_size({"width": width, "height": 900})
        self.page.emulate_media(media="print" if printed else "screen", color_scheme="dark" if dark else "light")
        self._leave()
        self.page.goto(page.resolve().as_uri() if isinstance(page, Path) else page)
        return self.page.evaluate(MEASURE)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    """Return the installed browser; without one, the test is skipped with a message."""
    sync_api = pytest.importorskip("playwright.sync_api")
    program = next((result for name in PROGRAMS if (result := shutil.which(name))), None)
    if program is None:
        pytest.skip(f"no browser on the path: {', '.join(PROGRAMS)}")
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=program, args=list(QUIET))
        yield started
        started.close()


@pytest.fixture
def window(chromium: Browser) -> Iterator[Window]:
    """Return a window of its own, without a permanent profile."""
    with chromium.new_context() as context:
        yield Window(context.new_page())
