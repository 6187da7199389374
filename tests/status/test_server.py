"""The relay's HTTP server over real sockets: its answers, and that no client can block it."""

import re
import socket
import threading
from contextlib import ExitStack, suppress
from dataclasses import replace

import pytest
from waitress.trigger import trigger

from syncrelay.config.listen import Listen
from syncrelay.errors import ListenError
from syncrelay.explain import BundleGraph, Endpoint, GroupReport, Mismatch, Refusal, Share, Tape
from syncrelay.status import Phase, Taps, server
from syncrelay.status.announcement import announced
from syncrelay.status.server import PATHS_TOLD, Server
from tests.status.support.serving import ANY, asked, connected, sent, serving
from tests.status.support.states import CAMERA, relay, started, working

HEALTHY = relay(working())
STOPPED = replace(working(), facts=replace(working().facts, failure="KeyError: 'x'"))
REFUSED = replace(
    working(),
    facts=replace(
        working().facts,
        inputs=tuple(
            replace(
                each,
                graph=replace(each.graph, refusal=Refusal("publish", each.output, str(each.type), why="no memory")),
            )
            for each in working().facts.inputs
        ),
    ),
)
UNBUNDLED = replace(
    working(),
    facts=replace(working().facts, bundle=BundleGraph("/set", refusal=Refusal("publish", "/set", "a/msg/B"))),
)
UNFIT = Endpoint("/usb_cam", CAMERA.type, Mismatch("reliability", "best_effort", "reliable"))


@pytest.mark.parametrize(
    ("accept", "content_type", "end"),
    [
        ("*/*", "text/plain; version=0.0.4", ""),
        ("application/openmetrics-text;version=1.0.0,text/plain;q=0.5", "application/openmetrics-text", "# EOF\n"),
    ],
)
def test_metrics_come_in_the_form_that_a_scraper_accepts_and_uncompressed(accept, content_type, end):
    asked_for = f"Host: localhost\r\nAccept: {accept}\r\nAccept-Encoding: gzip\r\nConnection: close"
    ask = f" /metrics HTTP/1.1\r\n{asked_for}\r\n\r\n"
    with serving(HEALTHY) as address:
        head, _, body = sent(address, f"GET{ask}".encode()).decode().partition("\r\n\r\n")
        without_body = sent(address, f"HEAD{ask}".encode()).decode()
    assert f"\r\nContent-Type: {content_type}" in head
    assert 'syncrelay_sets_total{group="front"} 30.0\n' in body
    assert body.endswith(end)
    assert without_body.endswith("\r\n\r\n")
    assert f"\r\nContent-Length: {len(body)}\r\n" in without_body


def test_the_root_is_a_page_of_files_that_are_all_there_and_of_nothing_else():
    with serving(HEALTHY) as address:
        code, page = asked(address, "/")
        assert code == 200
        links = set(re.findall(r'(?:src|href)="([^"]+)"', page)) - {"data:,"}
        assert links == {"colours.css", "page.css", "draw.js", "page.js", "status", "metrics"}
        assert {link: asked(address, f"/{link}")[0] for link in links} == dict.fromkeys(links, 200)
        head = sent(address, b"GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").partition(b"\r\n\r\n")[
            0
        ]
    assert b"Content-Security-Policy: default-src 'none'; script-src 'self';" in head


@pytest.mark.parametrize(
    ("state", "answer"),
    [
        (relay(), (200, "receiving\n")),
        (relay(turned_s=4.9), (200, "receiving\n")),
        (relay(turned_s=7.2), (503, "the receive loop last turned 7 s ago\n")),
    ],
    ids=["turns", "is slow", "hangs"],
)
def test_a_relay_lives_while_its_receive_loop_turns(state, answer):
    with serving(state) as address:
        assert asked(address, "/livez") == answer


@pytest.mark.parametrize(
    ("state", "answer"),
    [
        (HEALTHY, (200, "ready\n")),
        (relay(working(), phase=Phase.DRAINING), (503, "not ready: draining, see /status\n")),
        (relay(started(), phase=Phase.STARTING), (503, "not ready: starting, see /status\n")),
        (relay(), (503, "not ready: running, see /status\n")),
        (relay(working(), started(lidar=())), (503, "not ready: running, see /status\n")),
        (relay(started(camera=(UNFIT,))), (503, "not ready: running, see /status\n")),
        (relay(started(camera=(UNFIT, CAMERA))), (200, "ready\n")),
        (relay(started(camera=(Endpoint("/x", "std_msgs/msg/Int64"),))), (503, "not ready: running, see /status\n")),
        (relay(STOPPED), (503, "not ready: running, see /status\n")),
        (relay(REFUSED), (503, "not ready: running, see /status\n")),
        (relay(UNBUNDLED), (503, "not ready: running, see /status\n")),
    ],
    ids=[
        *("ready", "drains", "starts", "no group", "no publisher", "QoS does not fit", "one of two fits", "other type"),
        *("a bug stopped it", "refused by DDS", "no bundle"),
    ],
)
def test_a_relay_is_ready_while_every_required_input_is_served(state, answer):
    with serving(state) as address:
        assert asked(address, "/readyz") == answer


def _giving(left: int, *, possible: int = 100, asleep: bool = False) -> GroupReport:
    report = working()
    figures = replace(report.facts.figures, share=Share(left, possible, 10**10))
    return replace(report, facts=replace(report.facts, figures=figures, asleep=asleep))


@pytest.mark.parametrize(
    ("groups", "is_ready"),
    [
        ([_giving(80)], True),
        ([_giving(79)], False),
        ([_giving(100), _giving(10)], False),
        ([_giving(0, possible=0)], False),
        ([_giving(100), _giving(0, asleep=True)], True),
    ],
    ids=["enough", "too few", "one of two", "not known yet", "one sleeps"],
)
def test_where_the_file_asks_for_it_a_relay_is_ready_once_enough_sets_leave(groups, is_ready):
    state = relay(*groups)
    with serving(replace(state, ready_share=0.8)) as address:
        assert asked(address, "/readyz")[0] == (200 if is_ready else 503)
    with serving(state) as address:
        assert asked(address, "/readyz")[0] == 200


@pytest.mark.parametrize(("host", "is_reached"), [("127.0.0.1", False), ("0.0.0.0", True)])  # noqa: S104
def test_it_listens_at_its_address_and_nowhere_else(host, is_reached):
    # To the kernel, 127.0.0.2 is another address of this machine.
    with serving(HEALTHY, Listen(host, range(1))) as (_, port), socket.socket() as client:
        assert (client.connect_ex(("127.0.0.2", port)) == 0) is is_reached


def test_what_is_not_there_is_answered_with_what_is():
    with serving(HEALTHY) as address:
        assert asked(address, "/statsu") == (404, "there are /, /status, /tap, /metrics, /livez and /readyz\n")


def test_every_path_that_people_are_told_of_is_there():
    with serving(HEALTHY) as address:
        assert [path for path in PATHS_TOLD if asked(address, path)[0] == 404] == []


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE"])
def test_nothing_can_be_written(method):
    with serving(HEALTHY) as address:
        assert asked(address, "/status", method=method) == (405, "only GET\n")


def test_a_header_without_end_is_refused():
    with serving(HEALTHY) as address:
        endless = b"GET / HTTP/1.1\r\nHost: localhost\r\n" + b"X-Long: " + b"x" * 40_000
        # Unread data may cause a reset before the client has read the answer.
        with suppress(ConnectionError):
            assert b" 431 " in sent(address, endless).partition(b"\r\n")[0]
        assert asked(address, "/livez")[0] == 200


def test_clients_that_never_read_keep_nobody_from_an_answer():
    with serving(relay(*[working()] * 200)) as address, ExitStack() as stack:
        for _ in range(5):
            client = stack.enter_context(socket.socket())
            client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
            client.connect(address)
            client.sendall(b"GET /status HTTP/1.1\r\nHost: localhost\r\n\r\n" * 5)
        assert asked(address, "/livez")[0] == 200


@pytest.mark.parametrize(
    "request_so_far",
    [
        b"",
        b"GET /status HT",
        b"GET /status HTTP/1.1\r\nHost: localhost\r\n",
        b"POST / HTTP/1.1\r\nContent-Length: 9\r\n\r\nx",
    ],
    ids=["sends nothing", "stops in a line", "stops in the header", "stops in the body"],
)
def test_more_clients_that_stall_than_there_are_connections_keep_nobody_from_an_answer(request_so_far, monkeypatch):
    # None of them times out while the test runs.
    monkeypatch.setattr(server, "_CLIENT_TIMEOUT_S", 600)
    with serving(HEALTHY) as address, ExitStack() as stack:
        for _ in range(400):
            client = stack.enter_context(connected(address))
            with suppress(OSError):
                client.sendall(request_so_far)
        assert asked(address, "/livez") == (200, "receiving\n")


def test_an_exception_of_ours_is_a_500_and_the_server_lives_on():
    def broken():
        raise KeyError("no such group")

    with Server(ANY) as server:
        server.serve(broken, Taps(Tape(), str))
        address = server.place.host, server.place.port
        assert asked(address, "/status")[0] == 500
        assert asked(address, "/nowhere")[0] == 404


def test_a_port_that_is_taken_is_an_error_that_names_it_and_what_to_do():
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        with pytest.raises(ListenError) as caught:
            Server(Listen("127.0.0.1", range(port, port + 1)))
    assert str(caught.value) == (
        f"cannot listen on 127.0.0.1:{port}: another process uses it; set another `listen` in `metrics`, or write"
        " `metrics: null` to run without"
    )


@pytest.mark.parametrize("host", ["192.0.2.1", "nowhere.invalid"])
def test_an_address_that_this_machine_does_not_have_is_an_error_that_names_it(host):
    with pytest.raises(ListenError, match=rf"^cannot listen on {re.escape(host)}:0: .+"):
        Server(Listen(host, range(1)))


def test_of_several_ports_the_first_free_one_is_taken():
    with Server(ANY) as first:
        port = first.place.port
        # One of the next 50 ports is free.
        with Server(Listen("127.0.0.1", range(port, min(port + 50, 65_536)))) as second:
            assert port < second.place.port < port + 50


def test_it_ends_with_its_threads_and_its_port_whoever_is_connected():
    before = set(threading.enumerate())
    with ExitStack() as stack:
        with serving(HEALTHY) as address:
            for _ in range(20):
                stack.enter_context(connected(address)).sendall(b"GET /st")
            assert asked(address, "/livez")[0] == 200
        assert set(threading.enumerate()) == before
        with Server(Listen(address[0], range(address[1], address[1] + 1))):
            pass


def test_it_ends_though_something_else_woke_its_loop_first(monkeypatch):
    pull, before = trigger.pull_trigger, set(threading.enumerate())

    def pull_twice(*arguments):
        # It may end before it can be looked for.
        (loop,) = (each for each in set(threading.enumerate()) - before if each.name == "syncrelay-http")
        pull(*arguments)
        loop.join()
        pull(arguments[0])

    with serving(HEALTHY):
        monkeypatch.setattr(trigger, "pull_trigger", pull_twice)


def test_it_ends_where_it_never_served():
    with Server(ANY) as server:
        address = server.place.host, server.place.port
        assert server.place not in announced()
    with pytest.raises(ConnectionRefusedError):
        connected(address)
