"""Relays of this machine are found by the names that they announce, whatever else is announced."""

import os
import random
import subprocess
import sys

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config import Listen
from syncrelay.status.announcement import Place, announce, announced, places_in
from syncrelay.top.client import base_urls, search
from tests.status.support.serving import Relay
from tests.top import states

# An address of this process's own, as all relays of a machine share one name space.
HOST = f"127.77.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"
ROW = "0000000000000000: 00000002 00000000 00010000 0001 01 12345 @syncrelay-status/{}\n"


@pytest.mark.parametrize(
    ("listen", "reached_at"),
    [
        ("127.0.0.1", "127.0.0.1"),
        ("127.3.2.1", "127.3.2.1"),
        ("0.0.0.0", "127.0.0.1"),  # noqa: S104
        ("::1", "[::1]"),
        ("::", "[::1]"),
    ],
)
def test_a_relay_is_found_at_whatever_address_and_port_until_it_ends(listen, reached_at):
    try:
        relay = Relay(states.healthy(), Listen(listen, range(1)))
    except OSError:
        pytest.skip("this machine has no IPv6")
    place = Place(relay.address[1], relay.address[0])
    url = f"http://{reached_at}:{place.port}"
    try:
        # Other relays of this machine may be found too.
        assert base_urls(None).count(url) == 1
        # Enough on a busy machine.
        assert [answer.url for answer in search([url], timeout_s=60, whole_s=60).relays] == [url]
    finally:
        relay.stop()
    assert place not in announced()


def test_the_usual_ports_are_asked_too_but_where_one_answers_everywhere():
    usual = [f"http://127.0.0.1:{port}" for port in range(9464, 9474)]
    found = base_urls(None)
    everywhere = {place.port for place in announced() if place.is_everywhere}
    assert [url for url in usual if url not in found and int(url.rpartition(":")[2]) not in everywhere] == []
    assert len(set(found)) == len(found)


@pytest.mark.process
def test_of_a_relay_that_was_killed_nothing_is_left():
    place = Place(random.randrange(1, 65_536), HOST)
    program = (
        "import sys; from syncrelay.status.announcement import Place, announce;"
        f" kept = announce(Place({place.port}, {place.host!r})); print('up', flush=True); sys.stdin.read()"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout
        process.stdout.readline()
        assert place in announced()
        process.kill()
        process.wait()
        assert place not in announced()


def test_a_name_that_somebody_holds_already_keeps_no_relay_from_running():
    place = Place(random.randrange(1, 65_536), HOST)
    with announce(place), announce(place):
        assert announced().count(place) == 1


@given(st.lists(st.one_of(st.binary(max_size=80), st.text(max_size=40).map(lambda name: ROW.format(name).encode()))))
def test_names_that_are_none_are_passed_over(rows):
    right = ROW.format("127.0.0.1:9464").encode()
    assert Place(9464, "127.0.0.1") in places_in(b"\n".join([*rows, right]))


@pytest.mark.parametrize(
    "name", ["127.0.0.1:0", "127.0.0.1:65536", "127.0.0.256:80", "[::1::]:80", "robot:80", "127.0.0.1:80/x", "::1:80"]
)
def test_what_is_no_address_is_not_asked(name):
    assert places_in(ROW.format(name).encode()) == ()


def test_names_without_number_are_not_all_asked():
    table = "".join(ROW.format(f"127.0.0.1:{port}") for port in range(1, 5_000)).encode()
    assert 10 < len(places_in(table)) < 1000
