"""A page for this machine's browsers alone: served on the loopback interface until Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, HTTPServer, ThreadingHTTPServer

from irtscots_cl.system import interruption

ADDRESS = "127.0.0.1"
LOOK_SECONDS = 0.3  # between two looks for a signal


def page_server(page: Callable[[], bytes], port: int) -> HTTPServer:
    """A server of one page at /, made for each request, and of nothing else. port: 0 for any free one.

    It answers only where it is addressed as this machine: a page of another site, whose name was made to mean this
    machine, gets nothing. Raises ValueError for a port that cannot be had.
    """

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            host = (self.headers.get("Host") or "").rpartition(":")[0]
            found = self.path == "/" and host in (ADDRESS, "localhost")
            text = page() if found else b""
            self.send_response(200 if found else 404)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.send_header("Content-Length", str(len(text)))
            # the page's own styles and scripts, and nothing from elsewhere
            self.send_header("Content-Security-Policy", "default-src 'unsafe-inline' data:")
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, *_) -> None:
            """Nothing on stderr for each request."""

    if not 0 <= port <= 65535:
        raise ValueError(f"--port = {port}: must be 0 to 65535")
    try:
        server = ThreadingHTTPServer((ADDRESS, port), Handler)
    except OSError as error:
        raise ValueError(f"--port = {port}: {error.strerror}; must be another, or 0 for any free one") from None
    server.daemon_threads = True  # a browser's idle connection must not hold the end up
    return server


def serve_until_interrupted(server: HTTPServer) -> None:
    """Answer until Ctrl-C or SIGTERM, which is the way to end it and no error."""
    server.timeout = LOOK_SECONDS
    with server:
        while not interruption.requested():
            server.handle_request()
