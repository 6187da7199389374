"""Requests for the state over real sockets: to a relay, a closed port, other servers, servers that never finish."""

import random
import re
import socket
from contextlib import ExitStack, closing

import pytest

from syncrelay.errors import UsageError
from syncrelay.status.as_document import status_of
from syncrelay.top.client import NoAnswerError, OtherServerError, ask, base_urls, search
from tests.status.support.serving import running
from tests.top import states
from tests.top.speaker import HEAD, answering, slowly, speaking, without_end

_USUAL = [f":{port}" for port in range(9464, 9474)]
# Enough on a busy machine.
_PATIENT = {"timeout_s": 60, "whole_s": 60}


@pytest.fixture
def closed():
    """The URL of a closed port."""
    with closing(socket.create_server(("127.0.0.1", 0))) as opened:
        number = opened.getsockname()[1]
    return f"http://127.0.0.1:{number}"


def test_a_state_comes_back_as_it_was_told_and_no_proxy_of_the_environment_is_asked(monkeypatch, closed):
    monkeypatch.setenv("http_proxy", closed)
    told = status_of(states.healthy())
    with running(states.healthy()) as relay:
        answer = ask(relay.url)
    assert (answer.document, answer.status) == (told.as_json(), told)


@pytest.mark.parametrize(
    ("speech", "patience", "why"),
    [
        (lambda: slowly(b""), {"timeout_s": 0.2}, "no answer within 0.2 s"),
        (lambda: slowly(b"H"), {"whole_s": 0.3}, "no complete answer within 0.3 s"),
        (lambda: slowly(b"HTTP/1.1 100 Continue\r\n\r\n"), {"whole_s": 0.3}, "no complete answer within 0.3 s"),
        (lambda: slowly(HEAD), {"whole_s": 0.3}, "no complete answer within 0.3 s"),
        (lambda: without_end(b"HTTP/1.1 100 Continue\r\n\r\n"), {"whole_s": 0.3}, "no complete answer within 0.3 s"),
        (lambda: iter([b""]), _PATIENT, "the connection closed before the answer was complete"),
        (
            lambda: iter([b"HTTP/1.1 200 OK\r\nContent-Length: 99999999999\r\n\r\n{"]),
            _PATIENT,
            "the connection closed before the answer was complete",
        ),
    ],
    ids=["never begins", "slow letters", "goes on slowly", "slow body", "goes on", "says nothing", "says half of it"],
)
def test_who_does_not_answer_to_the_end_is_given_up(speech, patience, why):
    with speaking(speech) as url, pytest.raises(NoAnswerError, match=f"^{re.escape(why)}$"):
        ask(url, **patience)


_NOT_HTTP, _VERSION = "its answer is not HTTP", "or runs another version"


@pytest.mark.parametrize(
    ("speech", "why"),
    [
        ([b"SSH-2.0-OpenSSH_9.2\r\n"], _NOT_HTTP),
        ([b"HTTP/1.1 200 OK\r\n" + b"X: y\r\n" * 500 + b"\r\n"], _NOT_HTTP),
        ([b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n-5\r\nabc"], _NOT_HTTP),
        ([HEAD, b"[" * 1_000_000], _VERSION),
        ([HEAD, b'{"relay": ' * 100_000], _VERSION),
        ([HEAD, b'{"x": ' + b"[" * 100_000 + b"]" * 100_000 + b"}"], _VERSION),
        ([HEAD, b"\xff\xfe\x00"], _VERSION),
        ([HEAD, b'{"relay": {}, "groups": []}'], "runs another version (relay.node: Field required)"),
        ([HEAD, b'{"relay": {}, "groups": [], "\x1b[2J": 1}'], _VERSION),
        ([b"HTTP/1.1 302 Found\r\nLocation: file:///etc/passwd\r\n\r\n"], "it answers 302 Found"),
        ([b"HTTP/1.1 500 \x1b]0;owned\x07\r\n\r\n"], "it answers 500 \\x1b]0;owned\\x07"),
    ],
    ids=[
        *("SSH", "headers", "a negative chunk", "brackets", "unclosed", "nested", "no text", "a field", "escapes"),
        *("elsewhere", "a title"),
    ],
)
def test_who_answers_something_else_is_no_relay_and_writes_nothing_to_the_terminal(speech, why):
    with speaking(lambda: iter(speech)) as url, pytest.raises(OtherServerError, match=re.escape(why)) as caught:
        ask(url, **_PATIENT)
    assert str(caught.value).isprintable()


def test_any_noise_is_an_error_of_ours():
    """Documents and HTTP heads that are damaged in a few places."""
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


def test_an_unknown_machine_is_said():
    with pytest.raises(NoAnswerError, match="no machine with that name was found"):
        ask("http://robot.invalid:9464")


@pytest.mark.parametrize(
    ("written", "by", "why"),
    [
        (rb'"rate_hz":[0-9.]+', b'"rate_hz":NaN', "groups.0.rate_hz: Input should be a finite number"),
        (rb'"offset_ms":[0-9.]+', b'"offset_ms":1e999', "groups.0.inputs.0.offset_ms: Input should be a finite number"),
        (rb'"span_ms":[0-9.]+', b'"span_ms":-1e300', "groups.0.last_sets.0.span_ms: Input should be greater"),
        (rb'"possible_hz":[0-9.]+', b'"possible_hz":-1', "groups.0.possible_hz: Input should be greater"),
        (rb'"inputs":\[.*?\],"findings"', b'"inputs":[],"findings"', "groups.0.inputs: there is none"),
        (rb'{"set":\[[0-9]+,', b'{"set":[', "groups.0.recent: a set or drop does not fit the inputs"),
        (rb'{"set":\[[0-9]+,', b'{"set":[1%s,' % (b"0" * 400), "groups.0.recent: a set or drop does not fit"),
        (rb'{"set":\[[0-9]+,[0-9]+\]', b'{"set":[null,null]', "groups.0.recent: a set or drop does not fit"),
        (rb'{"drop":{"input":[01]', b'{"drop":{"input":2', "groups.0.recent: a set or drop does not fit"),
        (rb'"groups":\[({.*})\]', rb'"groups":[\1,\1]', "groups: two have the same name"),
    ],
)
def test_a_state_that_cannot_be_drawn_is_said_by_its_field(written, by, why):
    told = status_of(states.healthy()).as_json()
    changed = re.sub(written, by, told, count=1)
    assert changed != told
    with answering(changed) as url, pytest.raises(OtherServerError, match=rf"another version \({re.escape(why)}"):
        ask(url)


def test_a_relay_that_is_asked_by_a_name_that_it_does_not_go_by_says_what_to_write():
    # To the kernel 0.0.0.0 is this machine; to the relay it is not one of its own.
    with running(states.healthy()) as relay, pytest.raises(OtherServerError) as caught:
        ask(relay.url.replace("127.0.0.1", "0.0.0.0"))  # noqa: S104
    assert str(caught.value) == (
        "this relay does not answer to 0.0.0.0: if that is its name, write `metrics: {hosts: [0.0.0.0]}` in its file"
        " and restart it"
    )


def test_a_search_finds_relays_and_tells_what_else_answers(closed):
    with running(states.healthy()) as one, running(states.rig()) as two, answering(b"{}") as other:
        found = search([one.url, closed, two.url, other])
    assert [answer.url for answer in found.relays] == [one.url, two.url]
    assert [text.startswith(other) for text in found.others] == [True]
    assert search([closed]).others == (f"{closed}: nothing listens there",)


def test_relays_are_found_among_fifty_that_hang_or_never_end():
    # Each that never ends takes a core; with more than two, the relays in this process would not get their turn.
    speeches = [*[lambda: without_end(b"x")] * 2]
    speeches += [
        speech for _ in range(16) for speech in (lambda: slowly(b"H"), lambda: iter([b"?"]), lambda: slowly(b""))
    ]
    with ExitStack() as stack:
        urls = [stack.enter_context(speaking(speech)) for speech in speeches]
        relays = [stack.enter_context(running(states.healthy())).url for _ in range(2)]
        for patience_s in (3, 10, 40):
            # The longest is enough on a busy machine.
            found = search([*urls[:25], *relays, *urls[25:]], timeout_s=patience_s, whole_s=patience_s)
            if len(found.relays) == len(relays):
                break
    assert [answer.url for answer in found.relays] == relays
    assert len(found.others) == 50


@pytest.mark.parametrize(
    ("named", "urls"),
    [
        ("robot", [f"http://robot{port}" for port in _USUAL]),
        ("http://robot/", [f"http://robot{port}" for port in _USUAL]),
        ("robot:9464", ["http://robot:9464"]),
        ("http://robot:80/status", ["http://robot:80"]),
        ("https://fleet.example/robot1/", ["https://fleet.example/robot1"]),
        ("[::1]:9464", ["http://[::1]:9464"]),
        ("http://[::1]", [f"http://[::1]{port}" for port in _USUAL]),
    ],
)
def test_a_relay_is_named_by_host_port_or_url(named, urls):
    assert base_urls(named) == urls


@pytest.mark.parametrize("named", ["", "robot:port", "robot:99999", "ftp://robot", "http://"])
def test_what_names_no_relay_is_wrong_usage(named):
    with pytest.raises(UsageError, match="--url "):
        base_urls(named)
