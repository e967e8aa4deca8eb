"""`irtscots view`: the page in a file, and served on this machine alone until Ctrl-C."""

from __future__ import annotations

import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import pytest

from irtscots_cl.cli import main
from irtscots_cl.cli.loopback import page_server
from tests.support.stored_runs import store_run

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("view") / "one"
    store_run(folder)
    return folder


@pytest.fixture
def server():
    server = page_server(lambda: b"<p>it</p>", 0)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def test_a_file_is_written(folder, tmp_path, capsys):
    assert main(["view", str(folder), str(folder), "--out", str(tmp_path / "a.html"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": str(tmp_path / "a.html")}
    assert "sphere-deviated" in (tmp_path / "a.html").read_text(encoding="utf-8")


def test_the_page_alone_is_served(server):
    with urllib.request.urlopen(f"http://127.0.0.1:{server.server_port}/", timeout=10) as answer:
        assert answer.read() == b"<p>it</p>" and "default-src" in answer.headers["Content-Security-Policy"]
    assert server.server_address[0] == "127.0.0.1"
    for path, host, status in (
        ("/report.json", "127.0.0.1", 404),
        ("/../report.json", "127.0.0.1", 404),
        ("/?report.json", "127.0.0.1", 404),
        ("/", "elsewhere.example", 404),
        ("/", "localhost", 200),
    ):
        connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
        connection.request("GET", path, headers={"Host": f"{host}:{server.server_port}"})
        answer = connection.getresponse()
        assert answer.status == status and (answer.read() == b"") == (status == 404), (path, host)
        connection.close()


def test_ctrl_c_ends_it_without_a_word(folder):
    command = [sys.executable, "-m", "irtscots_cl", "view", str(folder), "--json"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as program:
        lines = [program.stdout.readline() for _ in range(3)]
        address = json.loads("".join(lines))["address"]
        idle = socket.create_connection(("127.0.0.1", int(address.rstrip("/").rpartition(":")[2])))
        with urllib.request.urlopen(address, timeout=10) as answer:
            assert b"sphere-deviated" in answer.read()
        program.send_signal(signal.SIGINT)
        try:
            _, err = program.communicate(timeout=20)
        finally:
            program.kill()
        idle.close()
    assert program.returncode == 0 and err == ""


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (["--port", "70000"], "irtscots: --port = 70000: must be 0 to 65535"),
        (
            ["--port", "8080", "--out", "a.html"],
            "irtscots: --port: must be left out with --out, which serves",
        ),
    ],
)
def test_a_bad_option_is_refused(folder, capsys, more, line):
    assert main(["view", str(folder), *more]) == 2
    assert capsys.readouterr().err.startswith(line)


def test_a_port_in_use_is_told(folder, server, capsys):
    assert main(["view", str(folder), "--port", str(server.server_port)]) == 2
    assert capsys.readouterr().err.startswith(f"irtscots: --port = {server.server_port}: Address already in use; ")
