"""Archives from a server of our own that breaks off, lies, and is not there."""

import gzip
import hashlib
import re
import ssl
import threading
import time
from http.client import HTTPResponse
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest

from evimo.cli import main
from evimo.recordings import downloading

CONTENT = gzip.compress(np.random.default_rng(0).integers(0, 256, 200_000, np.uint8).tobytes())


class Server:
    """What it holds, what it was asked for, and after how many bytes it breaks off."""

    def __init__(self):
        self.files, self.ranges, self.most, self.resumes = {}, [], None, "yes"
        self.held = threading.Event()  # while it is set, an answer waits after half
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                content = outer.files.get(self.path)
                if content is None:
                    self.send_error(404)
                    return
                asked = self.headers.get("Range")
                outer.ranges.append(asked)
                start = int(re.fullmatch(r"bytes=(\d+)-", asked)[1]) if asked and outer.resumes == "yes" else 0
                if start >= len(content):
                    self.send_error(416)
                    return
                self.send_response(206 if asked and outer.resumes != "no" else 200)
                self.send_header("Content-Length", str(len(content) - start))
                self.send_header("Content-Range", f"bytes {start}-{len(content) - 1}/{len(content)}")
                self.end_headers()
                stop = len(content) if outer.most is None else start + outer.most
                self.wfile.write(content[start : start + 1000])
                while outer.held.is_set():
                    time.sleep(0.02)
                self.wfile.write(content[start + 1000 : stop])

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self.server.server_address[1]}"


@pytest.fixture
def server():
    made = Server()
    made.files["/evimo1npz/eval_box_npz.tar.gz"] = CONTENT
    yield made
    made.server.shutdown()
    made.server.server_close()


def fetched(server, folder, *names):
    return main(["download", *(names or ("eval/box",)), "--out", str(folder), "--mirror", server.address])


def test_sizes_are_listed_without_fetching_anything(capsys):
    assert main(["download", "paper2019"]) == 0
    said = capsys.readouterr().out
    assert "   5.0 GB  train/box" in said
    assert "https://obj.umiacs.umd.edu/evimo1npz/train_box_npz.tar.gz" in said
    assert "   9.5 GB  in 6 archives" in said  # 5 + 2 of box and floor; .5 .9 .6 .5 of box, wall, table, fast
    assert "tabletop" not in said
    assert main(["download", "eval", "--kind", "raw"]) == 0
    assert "   3.5 GB  in 6 archives" in capsys.readouterr().out


def test_a_broken_connection_is_gone_on_with(server, tmp_path, capsys):
    server.most = 120_000
    assert fetched(server, tmp_path) == 2
    assert not (tmp_path / "eval_box_npz.tar.gz").exists()
    said = capsys.readouterr().err
    assert "broke off: eval_box_npz.tar.gz stopped after 120,000 of 2" in said and "goes on where it stopped" in said
    assert fetched(server, tmp_path) == 0
    assert server.ranges == [None, "bytes=120000-"]
    assert (tmp_path / "eval_box_npz.tar.gz").read_bytes() == CONTENT
    line = f"{hashlib.sha256(CONTENT).hexdigest()}  eval_box_npz.tar.gz\n"
    assert (tmp_path / "SHA256SUMS").read_text() == line
    assert fetched(server, tmp_path) == 0
    assert len(server.ranges) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SHA256SUMS", "eval_box_npz.tar.gz"]


def test_a_file_that_is_complete_but_was_never_named_is_kept(server, tmp_path):
    (tmp_path / "eval_box_npz.tar.gz.part").write_bytes(CONTENT)
    assert fetched(server, tmp_path) == 0
    assert (tmp_path / "eval_box_npz.tar.gz").read_bytes() == CONTENT


def test_damage_on_the_way_and_on_the_disk_is_found(server, tmp_path, capsys):
    spoilt = bytearray(CONTENT)
    spoilt[100_000] ^= 1
    server.files["/evimo1npz/eval_box_npz.tar.gz"] = bytes(spoilt)
    assert fetched(server, tmp_path) == 2
    assert "arrived damaged" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    server.files["/evimo1npz/eval_box_npz.tar.gz"] = CONTENT
    assert fetched(server, tmp_path) == 0
    (tmp_path / "eval_box_npz.tar.gz").write_bytes(bytes(spoilt))
    assert fetched(server, tmp_path) == 2
    assert "is not what SHA256SUMS says" in capsys.readouterr().err


def test_no_network_is_one_line(server, tmp_path, capsys):
    server.server.shutdown()
    server.server.server_close()
    assert fetched(server, tmp_path) == 2
    error = capsys.readouterr().err
    assert "no network: 127.0.0.1 cannot be reached" in error
    assert "Traceback" not in error


def test_a_fault_of_ssl_on_the_way_is_the_networks_not_the_disks(server, tmp_path, capsys, monkeypatch):
    def broken(*_, **__):
        raise ssl.SSLError(1, "record layer failure")

    for name in ("read", "urlopen"):
        with monkeypatch.context() as patched:
            patched.setattr(HTTPResponse if name == "read" else downloading, name, broken)
            assert fetched(server, tmp_path) == 2
        said = capsys.readouterr().err
        words = "the connection to 127.0.0.1 broke off" if name == "read" else "no network"
        assert words in said and "record layer failure" in said and "cannot be written" not in said


def test_what_is_not_there_is_said(server, tmp_path, capsys):
    assert fetched(server, tmp_path, "eval/wall") == 2
    assert re.search(r"the server says 404 .*\n  try: another --kind or --mirror", capsys.readouterr().err)
    assert fetched(server, tmp_path, "eval/moon") == 2
    assert "no archive 'eval/moon'" in capsys.readouterr().err
    assert main(["download", "--mirror", "file:///etc"]) == 2


@pytest.mark.parametrize("resumes", ["no", "it says so"])
def test_a_server_that_cannot_go_on_sends_it_all_again(server, tmp_path, capsys, resumes):
    """One that ignores what is asked for; and one that says that it goes on, and sends all."""
    server.most, server.resumes = 120_000, resumes
    assert fetched(server, tmp_path) == 2
    server.most = None
    assert fetched(server, tmp_path) == 0
    assert "120,000 bytes are fetched again" in capsys.readouterr().err
    assert (tmp_path / "eval_box_npz.tar.gz").read_bytes() == CONTENT


def test_a_server_that_falls_silent_is_one_error(server, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(downloading, "TIMEOUT_S", 0.3)
    server.held.set()
    assert fetched(server, tmp_path) == 2
    server.held.clear()
    assert "the connection to 127.0.0.1 broke off: timed out" in capsys.readouterr().err


def test_two_at_once_do_not_write_to_one_file(server, tmp_path, capsys):
    server.held.set()
    codes = []
    first = threading.Thread(target=lambda: codes.append(fetched(server, tmp_path)))
    first.start()
    while not server.ranges:
        time.sleep(0.01)
    assert fetched(server, tmp_path) == 2
    server.held.clear()
    first.join()
    assert codes == [0]
    assert "another process fetches eval_box_npz.tar.gz" in capsys.readouterr().err
    assert (tmp_path / "eval_box_npz.tar.gz").read_bytes() == CONTENT
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SHA256SUMS", "eval_box_npz.tar.gz"]


def test_one_that_ends_while_another_begins_is_in_nobodys_way(server, tmp_path, monkeypatch):
    """It removes the hidden folder after the other one has found it, and before that one has locked it."""
    usual, ends = downloading.locked, [True]

    def locked(folder, *, unsure):
        if ends:
            ends.pop()
            folder.rmdir()
        return usual(folder, unsure=unsure)

    monkeypatch.setattr(downloading, "locked", locked)
    (tmp_path / ".eval_box_npz.tar.gz.fetching").mkdir()
    assert fetched(server, tmp_path) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["SHA256SUMS", "eval_box_npz.tar.gz"]


def test_a_signal_before_the_hidden_folder_is_locked_leaves_none(server, tmp_path, monkeypatch):
    usual, signals = downloading.locked, [True]

    def locked(folder, *, unsure):
        if signals:
            signals.pop()
            raise KeyboardInterrupt
        return usual(folder, unsure=unsure)

    monkeypatch.setattr(downloading, "locked", locked)
    assert fetched(server, tmp_path) == 130
    assert not list(tmp_path.iterdir())
