"""Key files: readable by their owner alone, in pairs, and refused when they are something else."""

import json
import os
import stat

import pytest
import zmq

from bt_tasksim.core.errors import InputError, MachineError
from bt_tasksim.engines.remote import keys
from bt_tasksim.engines.remote.keys import CLIENT, SERVER, load_key, make_keys


@pytest.fixture
def pair(tmp_path):
    before = os.umask(0)  # whatever the umask allows
    try:
        return make_keys(tmp_path / "engine.key")
    finally:
        os.umask(before)


def test_a_pair_belongs_together_and_is_private(pair):
    server, client = pair
    assert [p.name for p in pair] == ["engine.key", "engine.client.key"]
    assert all(stat.S_IMODE(p.stat().st_mode) == 0o600 for p in pair)
    a, b = load_key(server, SERVER), load_key(client, CLIENT)
    assert a.peer == b.public and b.peer == a.public
    assert zmq.curve_public(a.secret) == a.public and zmq.curve_public(b.secret) == b.public
    assert a.secret.decode() not in repr(a), "a traceback does not show the secret"


def test_keys_are_never_overwritten(pair):
    with pytest.raises(InputError, match=r"engine.key' exists"):
        make_keys(pair[0])
    pair[0].unlink()
    with pytest.raises(InputError, match=r"engine.client.key' exists"):
        make_keys(pair[0])
    assert not pair[0].exists()


def test_there_are_two_files_or_none(tmp_path, monkeypatch):
    def full(path, side, key, write=keys._write):
        if side == CLIENT:
            raise MachineError("the disk is full")
        write(path, side, key)

    monkeypatch.setattr(keys, "_write", full)
    with pytest.raises(MachineError, match="is full"):
        make_keys(tmp_path / "engine.key")
    assert list(tmp_path.iterdir()) == []
    monkeypatch.undo()
    make_keys(tmp_path / "engine.key")


@pytest.mark.parametrize("path", [".", "", "/"])
def test_a_path_without_a_name_is_refused(path):
    with pytest.raises(InputError, match="names no file for a key"):
        make_keys(path)


def test_the_other_sides_key_is_refused(pair):
    with pytest.raises(
        InputError, match="is the server's key, and this is the client: take the pair's other"
    ):
        load_key(pair[0], CLIENT)
    with pytest.raises(InputError, match="is the client's key, and this is the server"):
        load_key(pair[1], SERVER)


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o660])
def test_a_key_that_others_can_read_is_refused(pair, mode):
    pair[0].chmod(mode)
    with pytest.raises(InputError, match="can be read by others on this machine: chmod 600"):
        load_key(pair[0], SERVER)


def _changed(path, **changes):
    content = {**json.loads(path.read_text()), **changes}
    path.write_text(json.dumps(content))


def test_what_is_no_key_is_refused(pair, tmp_path):
    with pytest.raises(InputError, match="cannot be read: No such file"):
        load_key(tmp_path / "none.key", SERVER)
    with pytest.raises(InputError, match="is no key file"):
        load_key(tmp_path, SERVER)
    own = load_key(pair[0], SERVER)
    for changes in (
        {"public": own.peer.decode()},
        {"secret": "x" * 40},
        {"secret": "é" * 40},
        {"peer": "short"},
        {"more": 1},
    ):
        text = pair[0].read_text()
        _changed(pair[0], **changes)
        with pytest.raises(InputError, match="does not hold a key"):
            load_key(pair[0], SERVER)
        pair[0].write_text(text)
    for text in ("", "[]", "{", '"x"', "\0" * 9000):
        pair[0].write_text(text)
        with pytest.raises(InputError, match="does not hold a key"):
            load_key(pair[0], SERVER)
