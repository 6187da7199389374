"""Where the file asks for no port, a relay does without one rather than not run."""

import socket

import pytest

from syncrelay.cli.run import listening
from syncrelay.config import Listen
from syncrelay.errors import ListenError


@pytest.fixture
def taken():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        yield range(port, port + 1)


def test_a_default_port_that_is_taken_is_a_warning(taken):
    with listening(Listen("127.0.0.1", taken, is_asked_for=False)) as server:
        assert server is None


def test_a_port_that_is_asked_for_is_needed(taken):
    with pytest.raises(ListenError):
        listening(Listen("127.0.0.1", taken))


def test_a_port_that_is_free_is_taken():
    with listening(Listen("127.0.0.1", range(1))) as server:
        assert server is not None
