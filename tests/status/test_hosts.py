"""Which host names the server answers to, over real sockets: the relay's, and never that of a page's own server."""

import re
import socket

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from syncrelay.config.listen import Listen
from tests.status.support.serving import ANY, asked, sent, serving
from tests.status.support.states import relay, working

HEALTHY = relay(working())
OPEN = Listen("0.0.0.0", range(1))  # noqa: S104  what a file may say
ALIAS = "robot_1.fleet.example"
NAMED = Listen("127.0.0.1", range(1), hosts=(ALIAS, "10.0.0.5", "fd00::5"))
# The name of the machine that runs the test.
THIS_MACHINE = socket.gethostname().lower()

LOOPBACK = ["localhost", "127.0.0.1", "127.0.0.53", "127.255.255.254", "[::1]", "[0:0:0:0:0:0:0:1]", "[::ffff:7f00:1]"]
# Nothing is listened on here: 0.0.0.0 is a host that is asked for.
_STRANGE = """
evil.example  localhost.evil.example  evil-localhost  localhost..  .localhost  127.0.0.1.evil.example  127.0.0.1.nip.io
127.0.0.256  127.1  0x7f.0.0.1  2130706433  0177.0.0.1  0.0.0.0  10.0.0.5  [fe80::1]  [::]  [::2]  [::1  ::1
[localhost]  [127.0.0.1]  [::1%]  localhost@evil.example  evil.example@localhost  localhost:port  localhost:1:2
localhost:123456  localhost,evil.example  localh\u00f6st
"""
STRANGE = [*_STRANGE.split(), f"{THIS_MACHINE}.evil.example"]


def told(answer: bytes) -> bool:
    """Whether an answer holds the state; a refusal must hold nothing of it."""
    is_told = answer.startswith((b"HTTP/1.1 200 ", b"HTTP/1.0 200 "))
    assert is_told == (b"/camera" in answer)
    return is_told


@pytest.fixture(scope="module")
def address():
    with serving(HEALTHY) as address:
        yield address


@pytest.mark.parametrize("path", ["/", "/status", "/metrics", "/nowhere"])
def test_a_name_of_somebody_else_is_refused_with_what_to_write(address, path):
    code, body = asked(address, path, host="evil.example:9464")
    assert code == 403
    assert body == (
        "this relay does not answer to evil.example: if that is its name, write `metrics: {hosts: [evil.example]}` in"
        " its file and restart it\n"
    )


@pytest.mark.parametrize("path", ["/livez", "/readyz"])
@pytest.mark.parametrize("host", ["evil.example", "syncrelay.robots.svc", "a b"])
def test_a_probe_is_answered_by_whatever_name(address, path, host):
    code, body = asked(address, path, host=host)
    assert (code, len(body.split())) == (200, 1)


def test_a_request_that_names_no_host_is_answered_where_http_had_none_yet(address):
    assert told(sent(address, b"GET /status HTTP/1.0\r\n\r\n"))
    refused = sent(address, b"GET /status HTTP/1.1\r\nConnection: close\r\n\r\n")
    assert not told(refused)
    assert refused.startswith(b"HTTP/1.1 400 ")
    assert refused.endswith(b"expected one `Host` header with a name or an address, and optionally a port\n")


_ANSWERED = {
    ANY: dict.fromkeys(LOOPBACK, 200),
    # Names that the file lists, and similar ones.
    NAMED: {
        **dict.fromkeys([ALIAS, ALIAS.upper(), f"{ALIAS}.:80", "10.0.0.5", "[fd00::5]:9464", "localhost"], 200),
        **dict.fromkeys(["fleet.example", f"a.{ALIAS}", "10.0.0.6", "robot-1.fleet.example"], 403),
    },
    # Open to other machines: any address, and the machine's name. 0.0.0.0 is what the log shows.
    OPEN: {
        **dict.fromkeys(["10.0.0.5:30464", "[fd00::5]", "[fe80::5%25eth0]:9464", "0.0.0.0", "localhost"], 200),  # noqa: S104
        **dict.fromkeys([THIS_MACHINE, THIS_MACHINE.upper(), f"{THIS_MACHINE.partition('.')[0]}.local"], 200),
        **dict.fromkeys(["syncrelay.robots.svc", f"{THIS_MACHINE}.evil.example", "10.0.0.5.evil.example"], 403),
    },
    # The name that `listen` has. The resolver takes 127.1 for 127.0.0.1; as a name it is only itself.
    Listen("LocalHost", range(1)): {"localhost": 200},
    Listen("127.1", range(1)): {"127.1": 200},
}


@pytest.mark.parametrize("listen", _ANSWERED, ids=str)
def test_what_the_file_lists_and_whoever_can_reach_it_decide_which_names_are_answered(listen):
    with serving(HEALTHY, listen) as (_, port):
        codes = {host: asked(("127.0.0.1", port), "/status", host=host)[0] for host in _ANSWERED[listen]}
    assert codes == _ANSWERED[listen]


def is_loopback(host: str) -> bool:
    """Whether a host is this machine: a slow reference that shares no code with hosts.py."""
    text = re.sub(r":[0-9]{0,5}$", "", host.lower()) if "]" in host or host.count(":") == 1 else host.lower()
    if text.startswith("[") and text.endswith("]"):
        return re.sub(r"%[a-z0-9._~-]+$", "", text[1:-1]) in {"::1", "0:0:0:0:0:0:0:1", "::ffff:7f00:1"}
    text = text.removesuffix(".")
    parts = text.split(".")
    is_address = len(parts) == 4 and all(re.fullmatch("0|[1-9][0-9]{0,2}", part) for part in parts)
    return text == "localhost" or (is_address and parts[0] == "127" and all(int(part) < 256 for part in parts))


def decorated(host: str, *, upper: bool, dot: bool, zone: str, port: str) -> str:
    """The same host, written otherwise."""
    if host.endswith("]"):
        return f"{host[:-1]}{zone}]{port}"
    return f"{host.upper() if upper else host}{'.' if dot else ''}{port}"


hosts = st.one_of(
    st.builds(
        decorated,
        st.sampled_from([*LOOPBACK, *STRANGE]),
        upper=st.booleans(),
        dot=st.booleans(),
        zone=st.sampled_from(["", "%lo", "%25eth0", "%a%b", "% "]),
        port=st.sampled_from(["", ":", ":9464", ":00080"]),
    ),
    # Texts of the letters of valid hosts.
    st.text(st.sampled_from("localhost127.0.0.1[:]%@,/\\\t evil"), max_size=12),
)
in_target = hosts.filter(lambda host: re.fullmatch(r"[!-~]+", host) and not set(host) & set("/\\?#"))


@settings(suppress_health_check=list(HealthCheck))
@given(
    named=st.lists(hosts, max_size=3),
    target=st.none() | in_target,
    version=st.sampled_from(["1.0", "1.1"]),
    header=st.sampled_from(["Host", "host", "HOST"]),
)
def test_the_state_is_told_only_to_who_names_one_host_and_that_is_this_machine(address, named, target, version, header):
    lines = [f"GET {'' if target is None else f'http://{target}'}/status HTTP/{version}", "Connection: close"]
    lines += [f"{header}: {host}" for host in named]
    # Blanks around the value of a header do not count.
    all_named = [*(host.strip(" \t") for host in named), *([] if target is None else [target])]
    is_asked_right = len(named) == 1 or (not named and version == "1.0")
    expected = is_asked_right and all(map(is_loopback, all_named))
    answer = sent(address, "".join(f"{line}\r\n" for line in [*lines, ""]).encode("latin-1"))
    assert told(answer) == expected, answer
    assert asked(address, "/livez")[0] == 200


def test_what_is_this_machine_is_known_without_the_code_under_test():
    assert not any(map(is_loopback, STRANGE))
    assert all(map(is_loopback, LOOPBACK))
