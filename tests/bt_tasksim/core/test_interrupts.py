"""Ctrl-C while a process starts: later for this one, never for that one."""

import multiprocessing
import os
import signal
import threading
import time

import pytest

from bt_tasksim.core.errors import Terminated
from bt_tasksim.core.interrupts import ending, held_back, terminable


def wait_and_say(pipe):
    pipe.send("here")
    time.sleep(0.3)
    pipe.send("still here")


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_a_process_started_meanwhile_is_never_interrupted(method):
    mine, theirs = multiprocessing.get_context(method).Pipe()
    process = multiprocessing.get_context(method).Process(target=wait_and_say, args=(theirs,))
    with held_back(spawning=method == "spawn"):
        process.start()
    os.kill(process.pid, signal.SIGINT)  # while it starts
    assert mine.poll(20.0) and mine.recv() == "here"
    os.kill(process.pid, signal.SIGINT)
    assert mine.poll(20.0) and mine.recv() == "still here"
    process.join()
    assert process.exitcode == 0


def test_this_thread_is_interrupted_afterwards():
    reached = False
    with pytest.raises(KeyboardInterrupt), held_back():
        signal.pthread_kill(threading.get_ident(), signal.SIGINT)  # this thread, not another one
        reached = True
    assert reached and signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, set())


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_is_an_interrupt_where_it_is_asked_for(number):
    reached = False
    before = signal.signal(number, signal.SIG_DFL)  # whoever started the tests may ignore it
    try:
        with pytest.raises(Terminated), terminable():
            signal.raise_signal(number)
            reached = True
        assert not reached and signal.getsignal(number) is signal.SIG_DFL
    finally:
        signal.signal(number, before)


def test_a_hangup_that_is_ignored_stays_so():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
    try:
        with terminable():
            signal.raise_signal(signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_sigterm_that_is_handled_already_stays_so():
    heard = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: heard.append(number))
    try:
        with terminable():
            signal.raise_signal(signal.SIGTERM)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert heard == [signal.SIGTERM]


def test_an_ending_is_not_broken_off():
    done = False
    with terminable():
        with ending():
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGTERM)
            signal.raise_signal(signal.SIGHUP)
            done = True
        assert done
        with pytest.raises(Terminated):
            signal.raise_signal(signal.SIGTERM)
    with pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


def test_other_threads_leave_signals_alone():
    seen = []

    def work():
        with terminable(), ending():
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [signal.SIG_DFL]
