"""Signals by a flag: where it is read, what wakes a wait, what a second signal does."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import replacing

ROOT = Path(__file__).parents[2]


def send(number=signal.SIGTERM):
    """A signal to this process; Python has run its handler when this returns."""
    signal.raise_signal(number)


def test_without_handling_nothing_is_ever_requested():
    interruption.check()
    assert not interruption.requested() and not interruption.is_handled()
    assert interruption.wait_for(threading.current_thread) is threading.current_thread()


@pytest.mark.parametrize("number", interruption.SIGNALS)
def test_a_signal_is_a_flag_until_somebody_checks(number):
    before = [signal.getsignal(n) for n in interruption.SIGNALS]
    with interruption.handled():
        interruption.check()
        send(number)
        assert interruption.requested()
        with pytest.raises(KeyboardInterrupt):
            interruption.check()
    assert [signal.getsignal(n) for n in interruption.SIGNALS] == before
    interruption.check()  # dropped with the block


def test_a_block_in_a_block_keeps_the_flag():
    with interruption.handled():
        with interruption.handled():
            send()
        with pytest.raises(KeyboardInterrupt):
            interruption.check()


def test_another_thread_handles_no_signals():
    found = []

    def work():
        with interruption.handled():
            found.append(interruption.is_handled())

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert found == [False]


def test_the_same_wish_sent_twice_ends_nothing_at_once():
    """timeout(1) signals a process, then its group."""
    with interruption.handled():
        send()
        send()
        assert interruption.requested()


def test_a_wait_ends_when_the_signal_comes():
    released = threading.Event()
    main = threading.main_thread().ident
    timer = threading.Timer(0.1, lambda: signal.pthread_kill(main, signal.SIGINT))
    with interruption.handled():
        timer.start()
        started = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            interruption.wait_for(lambda: released.wait(30))
        assert time.monotonic() - started < 5
        with pytest.raises(KeyboardInterrupt):  # of a signal that came before the wait
            interruption.wait_for(lambda: released.wait(30))
    released.set()


def test_a_wait_gives_the_result_or_the_error():
    with interruption.handled():
        assert interruption.wait_for(threading.current_thread) is not threading.current_thread()
        with pytest.raises(ZeroDivisionError):
            interruption.wait_for(lambda: 1 / 0)


def test_nothing_is_left_to_wake():
    with interruption.handled():
        for _ in range(3):
            interruption.wait_for(lambda: None)
        with interruption.before_the_end(lambda: None):
            pass
    assert interruption._wakes == interruption._last_acts == []


SECOND_SIGNAL = """
import os, signal, sys, time
from pathlib import Path
from irtscots_cl.system import interruption
from irtscots_cl.system.atomic_files import replacing
with interruption.handled(), replacing(Path("whole.txt")) as temporary:
    temporary.write_text("half")
    signal.raise_signal(signal.SIGTERM)
    print("flag", len(os.listdir()), flush=True)
    time.sleep(interruption.SAME_WISH_SECONDS + 0.1)
    signal.raise_signal(signal.SIGTERM)
    print("never")
"""


def test_a_second_signal_ends_the_process_at_once_and_leaves_no_half_file(tmp_path):
    done = subprocess.run([sys.executable, "-c", SECOND_SIGNAL], cwd=tmp_path, capture_output=True, text=True,
                          timeout=60, check=False, env=os.environ | {"PYTHONPATH": str(ROOT)})  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGTERM, "flag 1\n", "")
    assert os.listdir(tmp_path) == []


def test_no_file_is_begun_after_a_signal(tmp_path):
    with interruption.handled():
        send()
        with pytest.raises(KeyboardInterrupt), replacing(tmp_path / "file"):
            pytest.fail("begun")
    assert os.listdir(tmp_path) == []
