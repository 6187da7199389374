"""Asking for the state over real sockets: a relay, nobody, somebody else, somebody who never answers."""

import re
import socket
from contextlib import closing
from threading import Thread

import pytest

from syncrelay.errors import UsageError
from syncrelay.status import Level
from syncrelay.sync import DropReason
from syncrelay.top.client import NoAnswerError, OtherServerError, ask, base_urls, search
from tests.top import states
from tests.top.relay_server import serving

_USUAL = [f":{port}" for port in range(9464, 9474)]


@pytest.fixture
def closed_port():
    with closing(socket.create_server(("127.0.0.1", 0))) as opened:
        number = opened.getsockname()[1]
    # Closed again: nobody listens at it now.
    return int(number)


def test_a_state_comes_back_as_it_was_told():
    told = states.healthy()
    with serving(told) as server:
        answer = ask(server.url)
    assert answer.document == server.body
    (report,), (group,) = told.groups, answer.status.groups
    assert (answer.status.relay.node, answer.status.relay.ready, answer.status.relay.uptime_s) == (
        "/syncrelay",
        True,
        30,
    )
    assert (group.name, group.level, group.sets) == ("front", Level.OK, report.facts.figures.sets)
    assert group.recent == report.recent
    assert [each.topic for each in group.inputs] == ["/camera/image_raw", "/lidar/points"]
    camera = group.inputs[0]
    assert camera.dropped == {DropReason.TOO_FAR.value: report.facts.inputs[0].counts.dropped[DropReason.TOO_FAR]}
    assert [publisher.node for publisher in camera.publishers] == ["/camera_driver"]
    assert group.span_ms
    assert group.span_ms.p50 <= group.span_ms.p95 <= group.span_ms.max <= 20
    assert len(group.last_sets) == 100


def test_the_first_of_the_worst_findings_explains_a_group():
    with serving(states.rig()) as server:
        groups = ask(server.url).status.groups
    explanations = [group.explanation.code for group in groups if group.explanation]
    assert explanations == ["healthy", "other_clock", "short_queue", "no_publisher"]


def test_an_input_tells_its_offset_and_a_strange_key_is_left_aside():
    group = states.group({"/a": states.IMAGE, "/b": states.IMAGE})
    group["topics"][0]["offset"] = "-12ms"
    with serving(states.simulated(states.file(front=group), {})) as server:
        server.body = server.body.replace(b'"relay": {', b'"key_of_tomorrow": 1, "relay": {', 1)
        (shown,) = ask(server.url).status.groups
    assert [each.offset_ms for each in shown.inputs] == [-12, 0]


def test_nobody_there_is_said(closed_port):
    with pytest.raises(NoAnswerError, match="nothing listens there"):
        ask(f"http://127.0.0.1:{closed_port}")


def test_who_accepts_and_never_answers_is_given_up():
    with (
        closing(socket.create_server(("127.0.0.1", 0))) as silent,
        pytest.raises(NoAnswerError, match="no answer within 2 s"),
    ):
        ask(f"http://127.0.0.1:{silent.getsockname()[1]}")


def test_a_chunk_of_a_negative_size_is_said():
    with closing(socket.create_server(("127.0.0.1", 0))) as server:

        def answer() -> None:
            connection, _ = server.accept()
            with closing(connection):
                connection.recv(1000)
                connection.sendall(b"HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\n-5\r\nabc")

        thread = Thread(target=answer)
        thread.start()
        with pytest.raises(OtherServerError, match="its answer is not HTTP"):
            ask(f"http://127.0.0.1:{server.getsockname()[1]}")
        thread.join()


def test_an_unknown_machine_is_said():
    with pytest.raises(NoAnswerError, match="no machine with that name was found"):
        ask("http://robot.invalid:9464")


def test_a_relay_of_another_shape_is_said_by_the_field_that_it_lacks():
    with serving(states.nothing()) as server:
        server.body = b'{"relay": {}, "groups": []}'
        with pytest.raises(OtherServerError, match=r"runs another version \(relay.node: Field required\)"):
            ask(server.url)


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
    with serving(states.healthy()) as server:
        changed = re.sub(written, by, server.body, count=1)
        assert changed != server.body
        server.body = changed
        with pytest.raises(OtherServerError, match=rf"runs another version \({re.escape(why)}"):
            ask(server.url)


def test_another_http_server_is_said_with_its_answer():
    with serving(states.nothing()) as server, pytest.raises(OtherServerError, match="it answers 404"):
        ask(f"{server.url}/other")


def test_a_search_finds_relays_and_tells_what_else_answers(closed_port):
    closed = f"http://127.0.0.1:{closed_port}"
    with serving(states.healthy()) as one, serving(states.rig()) as two, serving(states.nothing()) as other:
        other.body = b"{}"
        found = search([one.url, closed, two.url, other.url])
    assert [answer.url for answer in found.relays] == [one.url, two.url]
    assert [text.startswith(other.url) for text in found.others] == [True]
    assert search([closed]).others == (f"{closed}: nothing listens there",)


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


def test_a_proxy_of_the_environment_is_not_asked(monkeypatch, closed_port):
    monkeypatch.setenv("http_proxy", f"http://127.0.0.1:{closed_port}")
    with serving(states.healthy()) as server:
        assert ask(server.url)
