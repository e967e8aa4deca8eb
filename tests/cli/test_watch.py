"""`irtscots watch`: what a running command tells in its folder, and what is read there."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import urllib.request

import pytest
from stored_runs import store_run
from synthetic import small_scene

from irtscots_cl.cli import job_file
from irtscots_cl.cli.job_file import FILE, MAP_FILE, JobFile, read_job
from irtscots_cl.cli.loopback import page_server
from irtscots_cl.cli.progress import Progress
from irtscots_cl.cli.watch import _page
from irtscots_cl.report.page.job import map_so_far


@pytest.fixture
def job(tmp_path, monkeypatch):
    """Of this process, a third through."""
    now = [100.0]
    monkeypatch.setattr("irtscots_cl.cli.progress.time.monotonic", lambda: now[0])
    with Progress(quiet=True, job=JobFile(tmp_path, ["run", "my mirror.toml"])) as progress:
        progress._known = "height error 3 nm"
        progress(0, 300)
        now[0] += 10.0
        progress(100, 300)
    monkeypatch.undo()
    return tmp_path


def changed(folder, **facts):
    path = folder / FILE
    path.write_text(json.dumps(json.loads(path.read_text()) | facts))


def test_a_run_tells_where_it_is_and_leaves_no_file(irtscots, tmp_path, monkeypatch, device):
    scene, out, told = tmp_path / "mine.toml", tmp_path / "out", []
    scene.write_text(small_scene("sphere-deviated", 25).to_toml())
    monkeypatch.setattr(job_file, "SECONDS", 0.0)
    for name in ("FIRST_ESTIMATE_SECONDS", "LINE_SECONDS", "COST_SHARE"):
        monkeypatch.setattr(f"irtscots_cl.cli.progress.{name}", 0.0)
    tell = JobFile.tell

    def and_read(self, doing, **facts):
        tell(self, doing, **facts)
        told.append((irtscots("watch", out, "--json")[1], (out / MAP_FILE).exists()))

    monkeypatch.setattr(JobFile, "tell", and_read)
    run = ("run", str(scene), "--out", str(out), "--no-figures", "--quiet", "--rays-per-pixel", "64")
    assert irtscots(*run)[0] == 0
    found = [json.loads(text) for text, _ in told]
    assert {facts["state"] for facts in found} == {"running"}
    assert {"tracing", "measuring", "storing"} <= {facts["doing"] for facts in found}
    assert all(facts["command"].startswith(f"irtscots run {scene}") for facts in found)
    assert any(there for _, there in told) and "height error" in found[-1]["so_far"]
    assert not {FILE, MAP_FILE} & set(os.listdir(out))


def test_a_running_job_in_words(job, irtscots):
    code, out, err = irtscots("watch", job, "--once")
    assert (code, err) == (0, "")
    lines = dict(line.split(": ", 1) for line in out.splitlines())
    assert lines["state"] == "running" and lines["so far"] == "height error 3 nm"
    assert lines["doing"] == "tracing, 33%, 100 of 300 rays, 10 rays/s, 0:20 left"
    assert lines["command"] == "irtscots run 'my mirror.toml'"


def test_the_files_go_and_a_folder_that_was_there_stays(tmp_path):
    with job_file.told_in(tmp_path, []) as own:
        own.tell("tracing")
        own.show({})
        assert sorted(os.listdir(tmp_path)) == [MAP_FILE, FILE]
    assert os.listdir(tmp_path) == []


def test_a_process_that_is_gone_is_dead(job, irtscots):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    changed(job, process=gone.pid)
    assert irtscots("watch", job, "--once")[1].startswith("state: died")
    changed(job, machine="elsewhere")
    assert read_job(job).state == "running"
    changed(job, updated=json.loads((job / FILE).read_text())["updated"] - 1000)
    assert read_job(job).state == "silent"


def test_what_is_over_is_told(tmp_path, irtscots):
    code, out, err = irtscots("watch", tmp_path, "--once")
    assert (code, out) == (2, "") and "must be the output folder of `irtscots run` at work" in err
    (tmp_path / "checkpoint").touch()
    assert "--resume" in irtscots("watch", tmp_path, "--once")[1]
    (tmp_path / "report.json").touch()
    assert irtscots("watch", tmp_path, "--once")[1].startswith("state: finished")
    (tmp_path / FILE).write_text("[1]")
    code, _, err = irtscots("watch", tmp_path, "--once")
    assert code == 2 and f"{FILE}: not written by this program" in err


def test_the_page_has_the_words_and_the_map_and_renews_itself(job, tmp_path_factory):
    page = _page(job)
    assert "height error 3 nm" in page and 'http-equiv="refresh"' in page and "map-title" not in page
    result = store_run(tmp_path_factory.mktemp("run") / "one").result
    JobFile(job, []).show(map_so_far(result))
    server = page_server(lambda: _page(job).encode(), 0)
    try:
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        with urllib.request.urlopen(f"http://127.0.0.1:{server.server_port}/", timeout=10) as answer:
            text = answer.read().decode()
        thread.join()
    finally:
        server.server_close()
    assert "map-title" in text and "deviation from the design" in text
