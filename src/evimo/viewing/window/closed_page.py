"""A page of this machine handed on so that the browser lets it speak to nobody else.

Rerun's page tells its makers about its use, asks for news and loads letters from the network. A browser refuses all of
that where the page comes with a policy that names this machine alone.
"""

import shutil
import socket
from collections.abc import Generator
from contextlib import contextmanager, suppress
from http.client import HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.error import URLError
from urllib.request import ProxyHandler, build_opener

HOST = "127.0.0.1"
POLICY = f"default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob: http://{HOST}:*"
HANDED_ON = ("Content-Type", "Content-Length", "Content-Encoding", "rerun-final-length")
GONE_S = 30.0


@contextmanager
def closed_page(inner: int) -> Generator[int]:
    """Hand on the page at a port of this machine from another one, which is given, while the `with` lasts."""
    direct = build_opener(ProxyHandler({}))  # a proxy that the user has for the network knows nothing of this machine

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            with suppress(ConnectionError):  # the browser has left
                if not self.path.startswith("/"):  # `@elsewhere` behind the port would be another machine
                    self.send_error(400)
                    return
                try:
                    with direct.open(f"http://{HOST}:{inner}{self.path}", timeout=GONE_S) as answer:
                        self.send_response(answer.status)
                        for name in HANDED_ON:
                            if value := answer.headers.get(name):
                                self.send_header(name, value)
                        self.send_header("Content-Security-Policy", POLICY)
                        self.end_headers()
                        shutil.copyfileobj(answer, self.wfile)
                except (URLError, HTTPException, TimeoutError, ValueError):  # of letters that no address has
                    self.send_error(404)

        def log_message(self, format: str, *args: object) -> None:
            pass

    with ThreadingHTTPServer((HOST, 0), Handler) as server:
        server.daemon_threads = True
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield server.server_address[1]
        finally:
            server.shutdown()
            thread.join()


def free_port() -> int:
    """A port of this machine that nobody listens at now."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
