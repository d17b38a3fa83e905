"""The evaluation channel listens to who knows the twin's secret, and to nobody else."""

from __future__ import annotations

import http.client
import socket
import threading
import time

import pytest

from bt_tasksim.core.errors import MachineError
from bt_tasksim.hardware.twin import evaluation
from bt_tasksim.hardware.twin.evaluation import EvaluationClient, EvaluationServer

SECRET = "0123456789abcdef0123456789abcdef"


@pytest.fixture
def asked():
    return []


@pytest.fixture
def server(asked):
    made, ended = EvaluationServer(0, SECRET), threading.Event()

    def answer(question):
        asked.append(question)
        return {"done": True}

    def serve():
        while not ended.is_set():
            made.answer(answer)
            time.sleep(0.005)

    thread = threading.Thread(target=serve)
    thread.start()
    yield made
    ended.set()
    thread.join()
    made.close()


def test_who_knows_the_secret_is_answered(server, asked):
    client = EvaluationClient(server.port, SECRET)
    assert client.ask(do="tell") == {"done": True}
    client.fault("frozen")
    assert asked == [{"do": "tell"}, {"do": "fault", "name": "frozen"}]
    client.close()


@pytest.mark.parametrize("secret", ["", "wrong", SECRET[:-1], SECRET + "0", '{"do": "tell"}'])
def test_nobody_else_is(server, asked, secret):
    client = EvaluationClient(server.port, secret)
    with pytest.raises(MachineError, match="does not answer"):
        client.ask(do="tell")
    client.close()
    assert asked == []


@pytest.mark.parametrize("method", ["POST", "GET", "OPTIONS"])
def test_a_browser_is_hung_up_on(server, asked, method):
    """What a page may send without being asked: any body as plain text."""
    browser = http.client.HTTPConnection("127.0.0.1", server.port, timeout=5.0)
    with pytest.raises((http.client.BadStatusLine, ConnectionError)):
        body = f'\n{SECRET[:-1]}\n{{"do": "fault", "name": "silent"}}\n'
        browser.request(method, "/", body, {"Content-Type": "text/plain"})
        browser.getresponse()
    browser.close()
    time.sleep(0.05)
    assert asked == []


def test_who_says_nothing_is_hung_up_on(server, monkeypatch):
    monkeypatch.setattr(evaluation, "GREETING", 0.1)
    with socket.create_connection(("127.0.0.1", server.port), 5.0) as idle:
        assert idle.recv(1) == b""


def test_a_secret_that_can_be_guessed_is_none():
    with pytest.raises(ValueError, match="at least 16 characters"):
        EvaluationServer(0, "")
