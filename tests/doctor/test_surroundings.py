"""The checks of environment, network, memory and limits, by values."""

import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.doctor.container import Isolation, check_isolation
from syncrelay.doctor.diagnosis import Severity
from syncrelay.doctor.discovery import check_discovery
from syncrelay.doctor.folders import check_folders
from syncrelay.doctor.network import Interface, check_network
from syncrelay.doctor.shared_memory import SharedMemory, ShmFile, check_shared_memory
from syncrelay.doctor.transport import check_transport, uses_defaults, uses_shared_memory
from syncrelay.environment.domain import domain_of, domains_in_use, ports_of, range_of
from syncrelay.environment.transport import PROFILES

ERROR, INFO = Severity.ERROR, Severity.INFO


def brief(diagnoses):
    return [(each.code, each.severity) for each in diagnoses]


@given(
    st.integers(0, 300),
    st.sampled_from(["{}{}{}", "{}{:#x}{}", "{}0{:o}{}"]),
    st.sampled_from(["", " ", "+"]),
    st.sampled_from(["", " ", ".5", "nodes"]),
)
def test_a_domain_is_read_as_ros_reads_it(number, form, before, after):
    # As rcl took them when it was tried: strtoul with base 0.
    domain = number if number <= 232 and (number or not after) else None
    assert domain_of({"ROS_DOMAIN_ID": form.format(before, number, after)}) == domain


def test_an_empty_domain_is_0_the_last_is_232_and_other_words_are_none():
    expected = {"": 0, "0": 0, "232": 232, "233": None, "-1": None, "abc": None, "08": None}
    assert {text: domain_of({"ROS_DOMAIN_ID": text}) for text in expected} == expected


LOCALHOST = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.mark.parametrize(
    ("environ", "found"),
    [
        ({}, []),
        ({"ROS_DOMAIN_ID": "101"}, []),
        ({"ROS_DOMAIN_ID": "102"}, [("domain_ports", INFO)]),
        ({"ROS_DOMAIN_ID": "232"}, []),
        ({"ROS_DOMAIN_ID": "010"}, [("domain_id", ERROR)]),
        ({"ROS_DOMAIN_ID": "x"}, [("domain_id", ERROR)]),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, []),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": ""}, []),
        (LOCALHOST, [("discovery_range", INFO)]),
        ({**LOCALHOST, "ROS_STATIC_PEERS": "10.0.0.2"}, []),
        ({"ROS_STATIC_PEERS": "127.0.0.1;no.such.host.invalid"}, [("static_peers", ERROR)]),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}, [("discovery_range", INFO)]),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "subnet"}, [("discovery_range", ERROR)]),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, [("discovery_off", ERROR)]),
        ({"ROS_LOCALHOST_ONLY": "0"}, []),
        ({"ROS_LOCALHOST_ONLY": "1"}, [("localhost_only", INFO)]),
        ({"ROS_LOCALHOST_ONLY": "1", **LOCALHOST}, [("discovery_range", INFO), ("localhost_only", INFO)]),
        ({"ROS_LOCALHOST_ONLY": "1", "ROS_STATIC_PEERS": "10.0.0.2"}, [("localhost_only", ERROR)]),
        ({"ROS_LOCALHOST_ONLY": "1", "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, [("localhost_only", ERROR)]),
    ],
)
def test_discovery_variables(environ, found):
    assert brief(check_discovery(environ, ephemeral_ports=(32768, 60999))) == found


@pytest.mark.parametrize(
    ("environ", "reach"),
    [
        ({}, "SUBNET"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, "OFF"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "everywhere"}, "LOCALHOST"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF", "ROS_LOCALHOST_ONLY": "1"}, "LOCALHOST"),
    ],
)
def test_discovery_reaches_as_far_as_ros_makes_of_it(environ, reach):
    assert range_of(environ) == reach


@pytest.mark.parametrize(
    ("value", "found", "shared"),
    [
        (None, [], True),
        ("DEFAULT", [], True),
        ("UDPv4", [], False),
        ("UDPv6", [], False),
        ("LARGE_DATA", [], True),
        ("LARGE_DATA?max_msg_size=1MB", [], True),
        ("SHM", [("transports", INFO)], True),
        ("NONE", [("transports", ERROR)], True),
        ("", [("transports", ERROR)], True),
        ("udpv4", [("transports", ERROR)], True),
    ],
)
def test_transports(value, found, shared):
    environ = {} if value is None else {"FASTDDS_BUILTIN_TRANSPORTS": value}
    assert brief(check_transport(environ)) == found
    assert uses_shared_memory(environ) == shared


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize(
    ("text", "fault"),
    [(None, "No such file or directory"), ("<dds>\n  <profiles>\n</dds>\n", "is not XML: mismatched")],
)
def test_a_profiles_file_that_cannot_be_read_is_named_with_the_cause(name, text, fault, tmp_path):
    path = tmp_path / "dds.xml"
    if text is not None:
        path.write_text(text)
    (diagnosis,) = check_transport({name: str(path)})
    assert diagnosis.what.startswith(f"{name}={path}: {fault}")
    assert not uses_defaults({name: str(path)})


LO = Interface("lo", is_up=True, is_loopback=True, multicast=False)
ETH = Interface("eth0", is_up=True, is_loopback=False, multicast=True)
VPN = Interface("wg0", is_up=True, is_loopback=False, multicast=False)
DOWN = Interface("eth1", is_up=False, is_loopback=False, multicast=True)


@pytest.mark.parametrize(
    ("interfaces", "reach", "middleware", "found"),
    [
        ([LO, ETH], "SUBNET", "rmw_fastrtps_cpp", []),
        ([LO], "LOCALHOST", "rmw_fastrtps_cpp", []),
        ([LO, DOWN], "SUBNET", "rmw_fastrtps_cpp", [("no_network", INFO)]),
        ([LO], "SUBNET", "rmw_cyclonedds_cpp", [("loopback_multicast", ERROR)]),
        ([LO, VPN], "SUBNET", "rmw_fastrtps_cpp", [("no_multicast", INFO)]),
        ([LO, VPN], "LOCALHOST", "rmw_fastrtps_cpp", []),
        ([LO, VPN, ETH], "SUBNET", "rmw_fastrtps_cpp", []),
        ([], "SUBNET", "rmw_fastrtps_cpp", [("loopback_down", ERROR)]),
        ([ETH], "SUBNET", "rmw_fastrtps_cpp", [("loopback_down", ERROR)]),
    ],
)
def test_interfaces(interfaces, reach, middleware, found):
    assert brief(check_network(interfaces, discovery_range=reach, middleware=middleware)) == found


@pytest.mark.parametrize(
    ("environ", "found"),
    [
        ({}, []),
        ({"SYNCRELAY_HEARTBEAT": "HERE/beat"}, []),
        ({"ROS_LOG_DIR": "", "ROS_HOME": "", "HOME": ""}, [("log_folder", INFO)]),
        ({"ROS_LOG_DIR": "", "ROS_HOME": "/proc/nowhere"}, [("log_folder", INFO)]),
        ({"SYNCRELAY_HEARTBEAT": "/nowhere/beat"}, [("heartbeat", ERROR)]),
        ({"SYNCRELAY_HEARTBEAT": "HERE/link"}, [("heartbeat", ERROR)]),
    ],
)
def test_what_must_be_written(environ, found, tmp_path):
    (tmp_path / "beat").write_text("00000000000000000042\n")
    (tmp_path / "link").symlink_to("beat")
    named = {"ROS_LOG_DIR": "HERE/log"} | environ
    assert brief(check_folders({name: text.replace("HERE", str(tmp_path)) for name, text in named.items()})) == found
    # A relay may write it now.
    assert (tmp_path / "beat").read_text() == "00000000000000000042\n"


MB = 1_000_000


def shm(*files, free=64 * MB, fault=None):
    memory = SharedMemory("/dev/shm", fault, total=64 * MB, free=free, uid=1000, files=files)  # noqa: S108
    return list(check_shared_memory(memory, domain=2))


def file(*, uid, is_live, port=None, size=549_408):
    return ShmFile("fastrtps_x", size, uid, f"user{uid}", is_live, port)


@pytest.mark.parametrize(
    ("diagnoses", "found"),
    [
        (shm(), []),
        (shm(file(uid=1000, is_live=True), file(uid=1000, is_live=True, port=7911)), []),
        (shm(fault="Read-only file system"), [("shm_unusable", INFO)]),
        (shm(free=500_000), [("shm_full", ERROR)]),
        (shm(free=2 * MB), [("shm_tight", INFO)]),
        (shm(file(uid=1000, is_live=False)), [("shm_stale", INFO)]),
        (shm(file(uid=0, is_live=False, port=7911)), [("shm_stale", INFO)]),
        (shm(file(uid=1000, is_live=True, port=7000, size=0)), [("shm_empty", ERROR)]),
        (shm(file(uid=1000, is_live=False, port=7000, size=0)), [("shm_stale", INFO)]),
        (shm(file(uid=1000, is_live=True, size=0)), []),
        # Domain 2 has the ports 7900 to 8149.
        (shm(file(uid=0, is_live=True), file(uid=0, is_live=True, port=7911)), [("shm_foreign", ERROR)]),
        (shm(file(uid=0, is_live=True), file(uid=0, is_live=True, port=7411)), [("shm_foreign", INFO)]),
        (shm(file(uid=0, is_live=True, port=7000)), []),
    ],
)
def test_shared_memory(diagnoses, found):
    assert brief(diagnoses) == found


def test_what_is_stale_is_counted_with_its_size_and_owner():
    (diagnosis,) = shm(file(uid=1000, is_live=False), file(uid=0, is_live=False))
    assert "2 Fast DDS files in /dev/shm" in diagnosis.what
    assert "1.1 MB, some of user0" in diagnosis.what
    assert "as root" in diagnosis.fix


CONTAINER = Isolation("/.dockerenv", host_network=True, private_shm=True)


@pytest.mark.parametrize(
    ("isolation", "environ", "found"),
    [
        (Isolation(None, host_network=True, private_shm=True), {}, []),
        (CONTAINER, {}, [("private_shm", ERROR)]),
        (CONTAINER, {"FASTDDS_BUILTIN_TRANSPORTS": "LARGE_DATA"}, [("private_shm", ERROR)]),
        (CONTAINER, {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}, []),
        (
            CONTAINER,
            {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"},
            [("private_shm", ERROR)],
        ),
        (Isolation("/.dockerenv", host_network=False, private_shm=True), {}, []),
        (Isolation("/.dockerenv", host_network=True, private_shm=False), {}, []),
        (Isolation(None, False, False, 29, "ulimit -u"), {}, [("task_limit", ERROR)]),  # noqa: FBT003
        (Isolation(None, False, False, 30, "ulimit -u"), {}, []),  # noqa: FBT003
    ],
)
def test_isolation(isolation, environ, found):
    assert brief(check_isolation(isolation, environ)) == found


def test_a_domain_is_in_use_while_a_participant_holds_its_two_ports():
    domain = 231
    ports = ports_of(domain)[24:26]
    assert domain not in domains_in_use()
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as two,
    ):
        one.bind(("127.0.0.1", ports[0]))
        assert domain not in domains_in_use()
        two.bind(("::1", ports[1]))
        assert domain in domains_in_use()
