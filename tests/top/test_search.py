"""Relays of this machine are found wherever they listen, and whatever else listens beside them."""

import os
import random
import subprocess
import sys
from contextlib import ExitStack

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config import Listen
from syncrelay.explain import Tape
from syncrelay.status import Taps, status_of
from syncrelay.status.announcement import Place, announce, announced, places_in
from syncrelay.status.server import Server
from syncrelay.top.client import NoAnswerError, OtherServerError, ask, base_urls, search
from tests.top import states
from tests.top.relay_server import serving
from tests.top.speaker import slowly, speaking, without_end

# Of this process alone: the names of all relays of a machine share one space.
HOST = f"127.77.{os.getpid() >> 8 & 255}.{os.getpid() & 255}"
# For a machine that others use too.
PATIENT = {"timeout_s": 60, "whole_s": 60}
HEAD = b"HTTP/1.1 200 OK\r\n\r\n"


@pytest.mark.parametrize(
    ("listen", "reached_at"),
    [("127.0.0.1", "127.0.0.1"), ("127.3.2.1", "127.3.2.1"), ("0.0.0.0", "127.0.0.1")],  # noqa: S104
)
def test_a_relay_is_found_at_whatever_port_until_it_ends(listen, reached_at):
    state = states.healthy()
    with Server(Listen(listen, range(1))) as server:
        url = f"http://{reached_at}:{server.place.port}"
        assert server.place not in announced()
        server.serve(lambda: state, Taps(Tape(), str))
        # Others of this machine may be there too.
        assert base_urls(None).count(url) == 1
        assert [answer.url for answer in search([url], **PATIENT).relays] == [url]
    assert server.place not in announced()


@pytest.mark.parametrize("listen", ["::1", "::"])
def test_a_relay_is_found_at_addresses_of_ip_6(listen):
    try:
        server = Server(Listen(listen, range(1)))
    except OSError:
        pytest.skip("this machine has no IPv6")
    state = states.healthy()
    with server:
        server.serve(lambda: state, Taps(Tape(), str))
        url = f"http://[::1]:{server.place.port}"
        assert base_urls(None).count(url) == 1
        assert [answer.url for answer in search([url], **PATIENT).relays] == [url]


def test_the_usual_ports_are_asked_too_but_where_one_answers_everywhere():
    usual = [f"http://127.0.0.1:{port}" for port in range(9464, 9474)]
    found = base_urls(None)
    everywhere = {place.port for place in announced() if place.is_everywhere}
    assert [url for url in usual if url not in found and int(url.rpartition(":")[2]) not in everywhere] == []
    assert len(set(found)) == len(found)


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


ROW = "0000000000000000: 00000002 00000000 00010000 0001 01 12345 @syncrelay-status/{}\n"


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


@pytest.mark.parametrize(
    "speech",
    [
        lambda: slowly(b"H"),
        lambda: slowly(b"HTTP/1.1 100 Continue\r\n\r\n"),
        lambda: slowly(HEAD),
        lambda: without_end(b"HTTP/1.1 100 Continue\r\n\r\n"),
    ],
    ids=["slow letters", "goes on slowly", "slow body", "goes on"],
)
def test_who_does_not_come_to_an_end_is_given_up(speech):
    with speaking(speech) as url, pytest.raises(NoAnswerError, match=r"^no complete answer within 0\.3 s$"):
        ask(url, whole_s=0.3)


@pytest.mark.parametrize("said", [b"", b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n{"])
def test_who_ends_before_the_answer_does_is_no_other_server(said):
    with (
        speaking(lambda: iter([said])) as url,
        pytest.raises(NoAnswerError, match="closed before the answer was complete"),
    ):
        ask(url, **PATIENT)


@pytest.mark.parametrize(
    "speech",
    [
        lambda: iter([b"SSH-2.0-OpenSSH_9.2\r\n"]),
        lambda: iter([b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 500 + b"\r\n"]),
        lambda: iter([HEAD, b"[" * 1_000_000]),
        lambda: iter([HEAD, b'{"relay": ' * 100_000]),
        lambda: iter([HEAD, b'{"x": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"]),
        lambda: iter([HEAD, b"\xff\xfe\x00"]),
        lambda: iter([b"HTTP/1.1 302 Found\r\nLocation: file:///etc/passwd\r\n\r\n"]),
        lambda: iter([b"HTTP/1.1 500 \x1b]0;owned\x07\r\n\r\n"]),
        lambda: iter([HEAD, b'{"relay": {}, "groups": [], "\x1b[2J": 1}']),
    ],
    ids=["SSH", "headers", "brackets", "unclosed", "nested", "no text", "elsewhere", "a title", "escapes"],
)
def test_who_answers_something_else_is_no_relay_and_writes_nothing_to_the_terminal(speech):
    with speaking(speech) as url, pytest.raises(OtherServerError) as caught:
        ask(url, **PATIENT)
    assert str(caught.value).isprintable()


def test_any_noise_is_an_error_of_ours():
    """A document that is damaged at a few places, and lines that are no HTTP."""
    chance = random.Random(15)
    whole = HEAD + status_of(states.rig()).as_json()
    damaged = b""
    with speaking(lambda: iter([damaged])) as url:
        for _ in range(150):
            changed = bytearray(whole[: chance.choice([20, 200, len(whole)])])
            for _ in range(chance.randrange(1, 6)):
                changed[chance.randrange(len(changed))] = chance.randrange(256)
            damaged = bytes(changed)
            try:
                ask(url)
            except (NoAnswerError, OtherServerError) as error:
                assert str(error).isprintable(), damaged[:200]  # noqa: PT017  any of them may be raised, or none


def test_relays_are_found_among_fifty_that_hang_or_never_end():
    # Those that never end take all of a core: two leave the relays, which share this process, their turn.
    speeches = [*[lambda: without_end(b"x")] * 2]
    speeches += [
        speech for _ in range(16) for speech in (lambda: slowly(b"H"), lambda: iter([b"?"]), lambda: slowly(b""))
    ]
    with ExitStack() as stack:
        urls = [stack.enter_context(speaking(speech)) for speech in speeches]
        relays = [stack.enter_context(serving(states.healthy())).url for _ in range(2)]
        for patience_s in (3, 10, 40):
            # At last long enough for a relay on a machine that others use too.
            found = search([*urls[:25], *relays, *urls[25:]], timeout_s=patience_s, whole_s=patience_s)
            if len(found.relays) == len(relays):
                break
    assert [answer.url for answer in found.relays] == relays
    assert len(found.others) == 50


def test_a_relay_that_is_asked_by_a_name_that_it_does_not_go_by_says_what_to_write():
    state = states.healthy()
    with Server(Listen("127.0.0.1", range(1))) as server:
        server.serve(lambda: state, Taps(Tape(), str))
        # To the kernel it is this machine; to the relay it is not one of its own.
        with pytest.raises(OtherServerError) as caught:
            ask(f"http://0.0.0.0:{server.place.port}")
    assert str(caught.value) == (
        "this relay does not answer to 0.0.0.0: if that is its name, write `metrics: {hosts: [0.0.0.0]}` in its file"
        " and restart it"
    )
