"""A server of pages on this machine's loopback, for nobody else.

Its address holds a token, without which nothing is answered. Requests that name another host, or come from a page of
another origin, are refused: another page in the same browser reaches nothing.
"""

import json
import secrets
import sys
import threading
from collections.abc import Collection
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import resources
from typing import TYPE_CHECKING, Any

from ..errors import InputError, shortage

if TYPE_CHECKING:
    from jinja2 import Template

HOST = "127.0.0.1"
WAIT_S = 10.0
"""So long a connection may take its time."""
POLICY = "img-src data:; base-uri 'none'; form-action 'none'"
HEADERS = (
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
)
HTML = "text/html; charset=utf-8"


class LoopbackServer:
    """Server of pages by a handler of requests. Port 0: any free port; `option` names it in a refusal.

    Raises
    ------
    InputError
        for a port that cannot be used
    """

    def __init__(self, port: int, handler: "type[LoopbackHandler]", option: str = "--port") -> None:
        self.token = secrets.token_urlsafe(18)
        try:
            self._server = _Server((HOST, port), handler)
        except (OSError, OverflowError) as error:
            reason = error.strerror if isinstance(error, OSError) and error.strerror else "must be from 0 to 65535"
            raise InputError(f"{option} {port}: {reason}") from error
        self._server.of = self
        self.port = int(self._server.server_address[1])
        self.address = f"http://{HOST}:{self.port}/{self.token}/"
        threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.2}, daemon=True).start()

    def close(self) -> None:
        """Serve no more."""
        self._server.shutdown()
        self._server.server_close()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    of: Any

    def handle_error(self, request: object, client_address: object) -> None:
        """Ignore errors of a client that goes away or is too slow: the terminal is the operator's."""
        error = sys.exc_info()[1]
        if error is None or not (isinstance(error, OSError) or shortage(error)):
            super().handle_error(request, client_address)  # pyright: ignore[reportArgumentType]


class LoopbackHandler(BaseHTTPRequestHandler):
    """Handler of requests that name this machine and the token."""

    server: _Server
    server_version, sys_version = "trihedron", ""
    timeout = WAIT_S

    def trusted(self, names: Collection[str]) -> str | None:
        """Return the name that a request asks for; None, after a refusal, of another host, token or name."""
        port, token = self.server.of.port, self.server.of.token
        if self.headers.get("Host") not in (f"{HOST}:{port}", f"localhost:{port}"):
            self.answer(403, b"another host")
            return None
        token_sent, slash, rest = self.path.removeprefix("/").partition("/")
        name = rest.partition("?")[0]
        if not secrets.compare_digest(token_sent.encode(), token.encode()) or not slash or name not in names:
            self.answer(404, b"nothing is here")
            return None
        return name

    def posted(self, most: int) -> bytes | None:
        """Return the body of a request from this server's own page; None, after a refusal, of another."""
        port = self.server.of.port
        if self.headers.get("Origin") not in (f"http://{HOST}:{port}", f"http://localhost:{port}"):
            self.answer(403, b"another origin")
            return None
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > most:
            self.answer(413, b"too long")
            return None
        body = self.rfile.read(int(length))
        if len(body) < int(length):
            self.answer(400, b"cut short")
            return None
        return body

    def posted_object(self, most: int) -> dict[str, Any] | None:
        """Return the JSON object of a request from this server's own page; None, after a refusal, of another."""
        if self.headers.get_content_type() != "application/json":
            self.answer(415, b"JSON is needed")
            return None
        body = self.posted(most)
        if body is None:
            return None
        try:
            content = json.loads(body)
        except (ValueError, RecursionError):
            content = None
        if not isinstance(content, dict):
            self.answer(400, b"not JSON")
            return None
        return content

    def answer(
        self,
        status: int,
        body: bytes,
        policy: str = "default-src 'none'",
        kind: str = HTML,
        *,
        in_frame: bool = False,
    ) -> None:
        """Send an answer; `in_frame`: this server's own page may show it in a frame."""
        self.send_response(status)
        if status != 204:
            self.send_header("Content-Type", kind if status == 200 else "text/plain")
            self.send_header("Content-Length", str(len(body)))
        ancestors = "'self'" if in_frame else "'none'"
        self.send_header("Content-Security-Policy", f"{policy}; frame-ancestors {ancestors}")
        self.send_header("X-Frame-Options", "SAMEORIGIN" if in_frame else "DENY")
        for name, value in HEADERS:
            self.send_header(name, value)
        self.end_headers()
        if status != 204:
            self.wfile.write(body)

    def answer_shell(self, page: str, nonce: str, further: str = "") -> None:
        """Send a page whose style and script carry a nonce."""
        policy = f"default-src 'none'; style-src 'nonce-{nonce}'; script-src 'nonce-{nonce}'; connect-src 'self'"
        self.answer(200, page.encode(), f"{policy}; {POLICY}{further}")

    def log_message(self, format: str, *args: Any) -> None:
        """The terminal is the operator's."""


class ShownHandler(LoopbackHandler):
    """Handler of a page whose changing part is the `page` of its server, in the shell of its `template`."""

    def do_GET(self) -> None:
        """Send the shell, or the changing part."""
        name = self.trusted(("", "now"))
        if name == "now":
            self.answer(200, self.server.of.page)
        elif name is not None:
            nonce = secrets.token_urlsafe(12)
            style = text_of("document", "page.css")
            shell = template_of("live", self.server.of.template).render(shell=True, nonce=nonce, style=style)
            self.answer_shell(shell, nonce)


@cache
def template_of(package: str, name: str) -> "Template":
    """Return a template of a page of a package of the tools; it escapes all texts."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["sentence"] = lambda text: text[:1].upper() + text[1:]
    return environment.from_string(text_of(package, name))


def text_of(package: str, name: str) -> str:
    """Return a file of a package of the tools."""
    return resources.files(f"trihedron.tools.{package}").joinpath(name).read_text(encoding="utf-8")
