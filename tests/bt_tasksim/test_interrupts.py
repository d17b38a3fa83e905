"""Ctrl-C while a process starts: later for this one, never for that one."""

import multiprocessing
import os
import signal
import threading
import time

import pytest

from bt_tasksim.interrupts import held_back


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
