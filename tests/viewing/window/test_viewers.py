"""Rerun's programs as children: closed to other machines, silent, and gone with their parent."""

import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from urllib.error import HTTPError
from urllib.request import ProxyHandler, build_opener

import pytest

from evimo.cli import main
from evimo.errors import BadInput
from evimo.viewing.window.closed_page import closed_page, free_port

FETCH = build_opener(ProxyHandler({})).open


class Inner(BaseHTTPRequestHandler):
    def do_GET(self):
        self.send_response(200)
        self.send_header("Content-Type", "text/plain")
        self.send_header("Content-Length", "5")
        self.end_headers()
        self.wfile.write(b"hello")

    def log_message(self, format, *args):
        pass


def test_a_page_is_handed_on_with_a_policy_that_names_this_machine_alone():
    with ThreadingHTTPServer(("127.0.0.1", 0), Inner) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        with closed_page(server.server_address[1]) as port, FETCH(f"http://127.0.0.1:{port}/any?url=x") as answer:
            assert answer.read() == b"hello"
            policy = answer.headers["Content-Security-Policy"]
        server.shutdown()
    allowed = [word for word in policy.split() if "://" in word]
    assert allowed == ["http://127.0.0.1:*"] and policy.startswith("default-src 'self'") and ";" not in policy


def test_an_address_cannot_lead_to_another_machine():
    """`GET @elsewhere/`, put behind the port, would be a name and password before another machine's name."""
    with closed_page(free_port()) as port, closing(HTTPConnection("127.0.0.1", port)) as browser:
        browser.putrequest("GET", "@example.org/")
        browser.endheaders()
        assert browser.getresponse().status == 400


def test_a_page_that_is_not_there_is_not_found():
    with closed_page(free_port()) as port, pytest.raises(HTTPError, match="404"):
        FETCH(f"http://127.0.0.1:{port}/")


def test_without_the_extra_one_line_says_how_to_get_it(film, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("evimo.errors.find_spec", lambda name: None)
    for arguments in (["--save", str(tmp_path / "new" / "f.rrd")], ["--web"], []):
        assert main(["view", str(film), *arguments]) == 2
        said = capsys.readouterr().err.splitlines()
        assert said[0] == "error: the window needs rerun" and "[view]" in said[1] and len(said) == 2
    assert not (tmp_path / "new").exists()


def test_without_a_screen_there_are_other_ways(film, monkeypatch, capsys):
    pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    assert main(["view", str(film)]) == 2
    said = capsys.readouterr().err
    assert "no screen" in said and "--web" in said


def test_a_browser_gets_the_page_and_ctrl_c_ends_both(film, tmp_path):
    pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")
    home = tmp_path / "home"
    quiet = os.environ | {"HOME": str(home), "TMPDIR": str(tmp_path), "DISPLAY": "", "WAYLAND_DISPLAY": ""}
    command = [sys.executable, "-m", "evimo.cli", "view", str(film), "--web"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=quiet) as viewer:
        assert viewer.stdout
        address = next((line.strip() for line in viewer.stdout if line.startswith("http://127.0.0.1:")), "")
        assert address
        with FETCH(address) as answer:
            assert b"<canvas" in answer.read() and answer.headers["Content-Security-Policy"]
        inner = int(address.rsplit("%3A", 1)[1].split("%2F")[0])
        viewer.send_signal(signal.SIGINT)
        _, errors = viewer.communicate(timeout=60)
        assert viewer.returncode == 0 and not errors, errors
    until_s = time.monotonic() + 10
    while time.monotonic() < until_s and _answers(inner):
        time.sleep(0.1)
    assert not _answers(inner)
    assert not list(tmp_path.glob("evimo-view-*"))
    assert not (home / ".config").exists()  # Rerun asked nothing about its use, and noted nobody down


def _answers(port):
    import socket

    try:
        socket.create_connection(("127.0.0.1", port), timeout=1).close()
    except OSError:
        return False
    return True


def test_a_clock_beyond_what_can_be_shown_is_refused(tmp_path):
    pytest.importorskip("rerun", reason="needs rerun-sdk: pip install 'evimo[view]'")
    from evimo.viewing.window.store import new_store

    with (
        pytest.raises(BadInput, match="cannot show the time"),
        new_store(tmp_path / "f.rrd", name="f", fix="another") as store,
    ):
        store.log("a", store.rr.Scalars(1.0), t_us=2**62)
    assert not list(tmp_path.iterdir())
