"""Addresses: what is one, and which are this machine's alone."""

import pytest

from bt_tasksim.core.errors import InputError
from bt_tasksim.engines.remote.address import listening, parse_remote


@pytest.mark.parametrize(
    ("name", "url", "loopback"),
    [
        ("remote:127.0.0.1:5599", "tcp://127.0.0.1:5599", True),
        ("remote:127.3.2.1:1", "tcp://127.3.2.1:1", True),
        ("remote:localhost:5599", "tcp://127.0.0.1:5599", True),
        ("remote:[::1]:5599", "tcp://[::1]:5599", True),
        ("remote:192.0.2.7:65535", "tcp://192.0.2.7:65535", False),
        ("remote:robot-cell.example:80", "tcp://robot-cell.example:80", False),
        ("remote:[2001:db8::1]:80", "tcp://[2001:db8::1]:80", False),
    ],
)
def test_addresses(name, url, loopback):
    address = parse_remote(name)
    assert address.url == url and address.loopback is loopback
    assert parse_remote(f"remote:{address}") == address


@pytest.mark.parametrize(
    "name",
    [
        "remote:", "remote:5599", "remote:host", "remote:host:", "remote:host:0", "remote:host:65536",
        "remote:host:-1", "remote:ho st:1", "remote:[host]:1", "remote:::1:5599", "remote:tcp://a:1",
        "remote:host:5٣",
    ],
)  # fmt: skip
def test_what_is_no_address_is_refused_with_the_name(name):
    with pytest.raises(InputError, match=r"should read remote:HOST:PORT|a port from 1|IP address"):
        parse_remote(name)


def test_a_server_listens_at_an_ip_address():
    assert listening("localhost", 0).loopback and listening("::1", 7).url == "tcp://[::1]:7"
    assert not listening("0.0.0.0", 0).loopback and not listening("::", 0).loopback
    for host in ("*", "eth0", "", "robot-cell"):
        with pytest.raises(InputError, match="does not name an IP address"):
            listening(host, 0)
    with pytest.raises(InputError, match="0 to 65535"):
        listening("127.0.0.1", 70000)
