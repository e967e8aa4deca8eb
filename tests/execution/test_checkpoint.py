"""Checkpoints: what is in one, when it is saved, and that a broken or foreign one never becomes a number."""

from __future__ import annotations

import errno
import io
import itertools
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from counting_job import PER_ITEM, RAYS, SOURCES, CountingJob, same

from irtscots_cl.execution import checkpoint
from irtscots_cl.execution.checkpoint import Checkpoints, Interrupted
from irtscots_cl.execution.checkpoint_file import (
    DIGEST_BYTES,
    FORMAT,
    MAX_HEADER_BYTES,
    digest_hash,
    hash_of,
    new_path,
    write_checkpoint,
)
from irtscots_cl.execution.executor import RunControl
from irtscots_cl.execution.launch_plan import Cursor
from irtscots_cl.execution.local import LocalExecutor
from irtscots_cl.execution.packed_sums import unpack
from irtscots_cl.execution.run_loop import run_rays
from irtscots_cl.scene.presets import load_scene
from irtscots_cl.system import interruption
from irtscots_cl.tracing.fingerprint import trace_fingerprint
from irtscots_cl.tracing.options import TraceOptions

FACTS = {"scene": "cd" * 16, "estimator": "adjoint", "seed": 1, "overfill": 1.0}
EXPECTED = run_rays(CountingJob(), RAYS)


@pytest.fixture
def eager(monkeypatch):
    """A save after every launch."""
    monkeypatch.setattr(checkpoint, "MIN_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "COST_SHARE", 0.0)


def run(keeper, job=None, facts=FACTS, stop_after=None, rays=RAYS):
    """Launches of 20 rays; interrupted after so many, if any."""
    seen = []

    def progress(*numbers):
        seen.append(numbers)
        keeper.stop = len(seen) == stop_after

    return run_rays(job or CountingJob(), rays, RunControl(progress, None, keeper.file_of(facts), 20))


def interrupted(path, stop_after=5, **more) -> bytes:
    """What an interrupted run leaves in the file."""
    with pytest.raises(Interrupted):
        run(Checkpoints(path), stop_after=stop_after, **more)
    return path.read_bytes()


def refusal(path, **more) -> str:
    """The one line that refuses to go on from the file, which stays."""
    before = path.read_bytes()
    with pytest.raises(ValueError, match="deleted") as caught:
        run(Checkpoints(path, resume=True), **more)
    message = str(caught.value)
    assert message.isprintable() and message.startswith(f"{path}: ")
    assert path.read_bytes() == before
    return message.removeprefix(f"{path}: ")


def split(data: bytes) -> tuple[dict, bytes]:
    """Header and arrays of a file."""
    line, rest = data.split(b"\n", 1)
    return json.loads(line.removeprefix(FORMAT)[33:]), rest[:-DIGEST_BYTES]


def joined(text: bytes, arrays: bytes) -> bytes:
    """A file with these and all its digests right."""
    data = FORMAT + hash_of(text).encode() + b" " + text + b"\n" + arrays
    return data + digest_hash(data).digest()


# --- signals -----------------------------------------------------------------------------------------------


def test_what_takes_longer_to_save_than_to_trace_again_is_not_saved(tmp_path, monkeypatch):
    """The sums of a large detector have gigabytes: a signal must not wait a minute for them."""
    path = tmp_path / "kept"
    before = interrupted(path, 2)
    monkeypatch.setattr(checkpoint, "BYTES_PER_SECOND", 1e-2)  # 100 s a byte
    with pytest.raises(Interrupted, match=r"^interrupted after 45% of the rays, of which the last 0 s are not saved: "):
        run(Checkpoints(path, resume=True), stop_after=4)
    assert path.read_bytes() == before  # so that --resume goes on from there
    path.unlink()
    with pytest.raises(Interrupted, match="after all of the rays, of which the last 0 s are not saved"):
        run(Checkpoints(path), stop_after=11)
    assert not path.exists()


def test_a_long_save_is_announced(tmp_path, monkeypatch):
    said = []
    monkeypatch.setattr(checkpoint, "LONG_SAVE_SECONDS", 0.0)
    monkeypatch.setattr(checkpoint, "BYTES_PER_SECOND", 1e12)
    with pytest.raises(Interrupted, match="^interrupted after 45% of the rays$"):
        run(Checkpoints(tmp_path / "kept", warn=said.append), stop_after=5)
    assert said == [f"{tmp_path / 'kept'}: saving takes about 0 s; a second signal ends it, without"]
    assert (tmp_path / "kept").exists()


def test_a_signal_while_the_sums_are_saved_ends_the_trace_without_another_save(tmp_path, eager, monkeypatch):
    written = []

    def write(path, *given):
        written.append(path)
        signal.raise_signal(signal.SIGTERM)
        write_checkpoint(path, *given)

    monkeypatch.setattr(checkpoint, "write_checkpoint", write)
    with interruption.handled(), pytest.raises(Interrupted, match="^interrupted after 11% of the rays$"):
        run(Checkpoints(tmp_path / "kept"))
    assert len(written) == 1


# --- content -----------------------------------------------------------------------------------------------


def test_a_file_holds_the_replicates_that_were_begun(tmp_path):
    header, arrays = split(interrupted(tmp_path / "kept", 5))
    assert header["place"] == [1, 4, 0, 0]
    assert header["facts"] == FACTS | CountingJob().fingerprint | {"byte_order": sys.byteorder}
    file = io.BytesIO(arrays)
    for expected in EXPECTED:  # two replicates of each array, the first complete
        found = np.zeros_like(expected[:2])
        unpack(file.read, found)
        np.testing.assert_array_equal(found[0], expected[0])
        assert found[1].any() and (found[1] != expected[1]).any()
    assert file.read() == b""
    assert joined(json.dumps(header).encode(), arrays) == (tmp_path / "kept").read_bytes()


def test_a_run_that_is_not_interrupted_leaves_nothing_before_it_is_time(tmp_path):
    assert same(run(Checkpoints(tmp_path / "kept")), EXPECTED)
    assert list(tmp_path.iterdir()) == []


def test_a_trace_at_its_end_is_kept_whole(tmp_path, eager):
    """So that what comes after it can be interrupted, and a study's traces are not repeated."""
    path = tmp_path / "kept"
    run(Checkpoints(path))
    job = CountingJob()
    assert same(run(Checkpoints(path, resume=True), job), EXPECTED)
    assert job.launches == []


def test_no_files_of_processes_that_were_killed_pile_up(tmp_path):
    path = tmp_path / "kept"
    new_path(path).write_bytes(b"half")
    interrupted(path)
    assert list(tmp_path.iterdir()) == [path]
    new_path(path).write_bytes(b"half")
    Checkpoints(path).remove()
    assert list(tmp_path.iterdir()) == []


def test_facts_of_a_trace_tell_all_that_it_depends_on(device):
    scene, rays, device_identity = load_scene("sphere"), np.array([10, 9]), LocalExecutor([device]).device_identity()
    facts = trace_fingerprint(scene, TraceOptions(), rays, device_identity)
    assert {"estimator", "sampler", "precision", "seed", "aim", "overfill", "smoothing"} < set(facts)
    assert (facts["rays_per_pixel"], facts["replicates"], facts["device"]) == (19, 2, device.name)
    assert facts["driver"] == device.driver and "version" in facts
    assert facts["scene"] != trace_fingerprint(load_scene("off-axis"), TraceOptions(), rays, device_identity)["scene"]
    assert len(json.dumps(facts)) < MAX_HEADER_BYTES / 4


# --- when --------------------------------------------------------------------------------------------------


def saves_of(monkeypatch, launch_seconds, save_seconds, launches):
    """Moments of the saves of a trace on a clock of its own, each (begun, ended)."""
    clock, saves = [0.0], []
    monkeypatch.setattr(checkpoint.time, "monotonic", lambda: clock[0])

    def write(*_):
        saves.append((clock[0], clock[0] + save_seconds))
        clock[0] += save_seconds

    monkeypatch.setattr(checkpoint, "write_checkpoint", write)
    sums = (np.zeros((1, 1000), np.uint64),)
    kept = Checkpoints(Path("none/kept")).file_of(FACTS)
    monkeypatch.setattr(Path, "mkdir", lambda *_, **__: None)
    kept.begin({}, np.array([launches]), 1, 1, sums)
    for launch in range(1, launches):
        clock[0] += launch_seconds
        kept.launched(Cursor(0, launch), clock[0], lambda: None)
    return saves, clock[0]


@pytest.mark.parametrize("save_seconds", [0.001, 0.09, 1.0, 20.0])
def test_saving_takes_less_than_2_percent_of_the_time(monkeypatch, save_seconds):
    saves, total = saves_of(monkeypatch, 0.4, save_seconds, 40_000)
    later = saves[1:]  # the first is not yet known to take that long
    assert later and sum(end - begin for begin, end in later) < 0.02 * (total - saves[0][1])
    gaps = [b[0] - a[1] for a, b in itertools.pairwise(saves)]
    assert max(gaps) <= max(5.0, 50 * save_seconds) + 0.4 + 1e-6  # nor is it put off for longer
    assert 5.0 <= saves[0][0] < 5.5


def test_a_limit_of_time_ends_a_trace_with_its_sums_saved(tmp_path):
    path = tmp_path / "kept"
    with pytest.raises(Interrupted, match=re.escape("--max-seconds 1e-09: stopped after 11% of the rays")):
        run(Checkpoints(path, max_seconds=1e-9))
    assert split(path.read_bytes())[0]["place"] == [0, 4, 0, 0]


def test_a_trace_that_is_through_is_not_ended_by_its_limit_of_time(tmp_path):
    keeper = Checkpoints(tmp_path / "kept", max_seconds=1e-9)
    found = run_rays(CountingJob(), RAYS[:1], RunControl(None, None, keeper.file_of(FACTS), 1000))
    assert same(found, [array[:1] for array in EXPECTED])


# --- other runs, damage ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("job", "facts", "words"),
    [
        ({}, {"seed": 2}, "of another run: seed = 2, here 1; must be the same"),
        ({}, {"overfill": 1.5, "estimator": "forward"}, "estimator = forward, here adjoint; overfill = 1.5, here 1.0"),
        ({}, {"scene": "ef" * 16}, "of another run: other scene; must"),
        ({"code": "other"}, {}, "of another run: other code; must"),
        ({"code": "other"}, {"seed": 2}, "of another run: seed = 2, here 1; must be the same"),
        ({"code": "other", "inputs": "x"}, {}, "of another run: other code; must"),
        ({"inputs": "x"}, {}, "of another run: other inputs; must"),
        ({"inputs": "x"}, {"scene": "ef" * 16}, "of another run: other scene; must"),
        ({}, {"more": 3}, "of another run: more = 3, here none; must"),
    ],
)
def test_a_file_of_another_run_is_refused_by_what_differs(tmp_path, job, facts, words):
    path, other = tmp_path / "kept", CountingJob()
    other.fingerprint = other.fingerprint | job
    interrupted(path, job=other, facts=FACTS | facts)
    assert words in refusal(path)


def test_a_file_with_other_shapes_or_rays_is_refused(tmp_path):
    """They follow from the facts, so this would be a bug; no number comes of it all the same."""
    path = tmp_path / "kept"
    interrupted(path, job=CountingJob(size=2))
    assert refusal(path).startswith("damaged")
    interrupted(path, stop_after=8)
    assert refusal(path, rays=RAYS[:1]).startswith("damaged")


def test_every_flipped_bit_and_every_truncation_is_noticed(tmp_path):
    path = tmp_path / "kept"
    whole = interrupted(path)
    for cursor in range(len(whole)):
        path.write_bytes(whole[:cursor])
        assert refusal(path).startswith("damaged")
        path.write_bytes(whole[:cursor] + bytes([whole[cursor] ^ 1 << cursor % 8]) + whole[cursor + 1 :])
        assert refusal(path).startswith("damaged")
    path.write_bytes(whole + b"\0")
    assert refusal(path).startswith("damaged")
    path.write_bytes(whole)
    assert same(run(Checkpoints(path, resume=True)), EXPECTED)


def mutated(dice: random.Random, data: bytes) -> bytes:
    """Some bytes changed, left out, repeated or brought in."""
    data = bytearray(data)
    for _ in range(dice.choice((1, 1, 2, 5))):
        at, length = dice.randrange(len(data) + 1), dice.choice((1, 1, 4, 40))
        change = dice.randrange(5)
        if change == 0:
            data[at : at + length] = dice.randbytes(length)
        elif change == 1:
            del data[at : at + length]
        elif change == 2:
            data[at:at] = data[at : at + length]
        elif change == 3:
            data[at:at] = dice.randbytes(length)
        else:
            data[at:at] = str(dice.choice((-1, 2**31, 2**64, 10**100, 1e308))).encode()
    return bytes(data)


VALUES = [None, True, -1, 0, 1, 3, 4, 5, 2**31, 2**63, 2**64, 10**300, 0.5, -0.0, 1e308, float("nan"), float("inf"), "",
          "0", "\x1b[2J\n", "x" * 5000, [], [0], [0, 0, 0, 0], [[0]] * 4, {}, {"trace": 0.0}]  # fmt: skip


def forged(dice: random.Random, header: dict) -> bytes:
    """A header with something else in it."""
    header = json.loads(json.dumps(header))
    for _ in range(dice.choice((1, 1, 2))):
        inner = dice.choice([header, *(part for part in header.values() if isinstance(part, dict | list) and part)])
        key = dice.choice(list(inner) if isinstance(inner, dict) else range(len(inner)))
        inner[key] = dice.choice(VALUES)
        if dice.random() < 0.1 and isinstance(inner, dict):
            del inner[key]
        if dice.random() < 0.1 and isinstance(inner, dict):
            inner[dice.choice(("margin", "more", "\x1b[2J", "y" * 500))] = dice.choice(VALUES)
    return json.dumps(header).encode()


def is_a_place_of_the_plan(text: bytes) -> bool:
    """Whether the header's place is another than the sums', yet possible: nothing but the digests tells of that."""
    try:
        Cursor(*json.loads(text)["place"]).check(RAYS, SOURCES, PER_ITEM)
    except (TypeError, ValueError, KeyError, RecursionError):
        return False
    return True


def outcome(path, data) -> str:
    """Refused, started afresh, or went on: with the right sums, whatever the file holds."""
    path.write_bytes(data)
    try:
        found = run(Checkpoints(path, resume=True))
    except ValueError as error:
        message = str(error)
        assert message.isprintable() and message.startswith(f"{path}: ") and len(message) < 1000
        return "refused"
    assert same(found, EXPECTED)
    return "went on"


def test_mutated_files_never_become_a_number(tmp_path):
    path, dice, outcomes = tmp_path / "kept", random.Random(1), []
    seeds = [interrupted(path, stop_after) for stop_after in (1, 4, 6, 8)]
    for _ in range(1200):
        data = mutated(dice, dice.choice(seeds))
        outcomes.append(outcome(path, data) if data not in seeds else "the same")
    assert outcomes.count("refused") + outcomes.count("the same") == 1200 and outcomes.count("refused") > 1100
    foreign = [b"", b"\n", FORMAT, b"\x89HDF\r\n", b"PK\3\4" + bytes(100), dice.randbytes(5000), b"[" * 20_000]
    assert [outcome(path, data) for data in foreign] == ["refused"] * len(foreign)


def test_forged_headers_with_right_digests_never_become_a_number(tmp_path):
    path, dice, outcomes = tmp_path / "kept", random.Random(2), []
    header, arrays = split(interrupted(path))
    texts = [forged(dice, header) for _ in range(800)]
    texts += [b"[" * 16_000, b"9" * 16_000, b"{}", b"[]", b"1e999", b"\xff", b'{"facts": {}}', b'{"facts": 1}']
    tracemalloc.start()
    for text in texts:
        if json.dumps(header["place"]).encode() not in text and is_a_place_of_the_plan(text):
            continue
        # more or less of the sums than the place says, too
        more = dice.choice((arrays, arrays, arrays[:-8], arrays + bytes(8), b"", arrays * 2))
        outcomes.append(outcome(path, joined(text, more)))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(outcomes) > 700 and outcomes.count("refused") > 500
    assert outcomes.count("went on") > 2  # with other seconds alone
    assert peak < 10e6  # the sums take a kilobyte


def test_a_header_is_read_no_further_than_it_can_be_long(tmp_path):
    path = tmp_path / "kept"
    header, arrays = split(interrupted(path))
    texts = [json.dumps(header).encode() + b" " * length for length in (1000, MAX_HEADER_BYTES, 10**7)]
    assert [outcome(path, joined(text, arrays)) for text in texts] == ["went on", "refused", "refused"]


def test_a_margin_from_a_file_is_one_that_windows_can_have(tmp_path):
    path = tmp_path / "kept"
    header, arrays = split(interrupted(path))
    found = []
    for margin in (2, 8, 3, 10**9, -1, True, "2", None):
        text = json.dumps(header | {"facts": header["facts"] | {"margin": margin}}).encode()
        path.write_bytes(joined(text, arrays))
        found.append(Checkpoints(path, resume=True).file_of(FACTS).saved("margin", (1, 2, 4, 8)))
    assert found == [2, 8, 1, 1, 1, 1, 1, 1]
    assert Checkpoints(path).file_of(FACTS).saved("margin", (1, 2, 4, 8)) == 1


# --- disks -------------------------------------------------------------------------------------------------


def test_a_full_disk_leaves_the_old_file_and_the_trace_goes_on(tmp_path, eager, monkeypatch):
    path, warned, synced = tmp_path / "kept", [], []

    def full(descriptor, fsync=os.fsync):
        synced.append(descriptor)
        if len(synced) > 6:  # two for each file
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", full)
    assert same(run(Checkpoints(path, warn=warned.append)), EXPECTED)
    assert warned == [f"{path}: cannot be saved: No space left on device; tracing continues"]
    assert [file.name for file in tmp_path.iterdir()] == ["kept"]
    monkeypatch.undo()
    job = CountingJob()
    assert same(run(Checkpoints(path, resume=True), job), EXPECTED)
    assert 0 < len(job.launches) < 9


def test_a_file_that_grows_too_large_is_not_left_in_part(tmp_path, eager):
    path, warned, limits = tmp_path / "kept", [], resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        job = CountingJob(size=4000)  # 160 kB for a replicate
        run(Checkpoints(path, warn=warned.append), job)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(warned) == 1 and "File too large" in warned[0]
    assert list(tmp_path.iterdir()) == []


def test_an_interrupted_trace_that_cannot_be_saved_ends_all_the_same(eager):
    keeper = Checkpoints(Path("/proc/none/kept"), warn=lambda line: None)
    with pytest.raises(Interrupted):
        run(keeper, stop_after=2)
    assert keeper.files() == []


def killed_again_and_again(what, kills):
    folder = Path(__file__).parents[1] / "support"
    program = [sys.executable, folder / "kill_and_resume.py", what, str(kills)]
    paths = {"PYTHONPATH": f"{folder.parent}:{folder}"}
    done = subprocess.run(program, text=True, check=True, capture_output=True, env=os.environ | paths)
    found = json.loads(done.stdout)
    assert found["equal"]
    assert found["kills"] == kills and found["went_on"] > kills // 3 and found["ended"] > 1
    assert set(found["left"]) <= {"kept", "kept.new"}


def test_a_run_killed_50_times_ends_with_the_same_bits():
    killed_again_and_again("count", 50)


@pytest.mark.slow
def test_a_trace_killed_50_times_ends_with_the_same_bits():
    killed_again_and_again("trace", 50)


# --- many traces -------------------------------------------------------------------------------------------


def test_each_trace_of_a_study_has_its_file(tmp_path, eager):
    folder = tmp_path / "checkpoints"
    keeper = Checkpoints(folder, many=True)
    for seed in (1, 2, 3):
        run(keeper, CountingJob(seed), FACTS | {"seed": seed}, stop_after=None)
    assert len(keeper.files()) == 3
    again, jobs = Checkpoints(folder, resume=True, many=True), [CountingJob(seed) for seed in (1, 2, 4)]
    for job, seed in zip(jobs, (1, 2, 4), strict=True):
        assert same(run(again, job, FACTS | {"seed": seed}), run_rays(CountingJob(seed), RAYS))
    assert [len(job.launches) for job in jobs[:2]] == [0, 0] and jobs[2].launches
    with pytest.raises(ValueError, match=r"checkpoints: left by an interrupted run; must be continued by --resume"):
        Checkpoints(folder, many=True).check_start()
    again.check_start()
    again.remove()
    assert list(tmp_path.iterdir()) == []
