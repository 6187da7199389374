"""Data through a relay in a container, with the networks and users that robots have."""

import pytest

from tests.container.docker import HARDENED
from tests.container.stages import CONFIG, assert_relayed

pytestmark = pytest.mark.container


def test_it_serves_nodes_on_the_host_with_nothing_writable_no_capability_and_a_user_that_nobody_knows(relays, host):
    relay = relays.run(CONFIG, "--network=host", "--user=4711:4712", *HARDENED)
    assert_relayed(host)
    relay.wait_for_health("healthy")


def test_it_serves_them_with_not_even_a_place_for_its_log(relays, host):
    relay = relays.run(CONFIG, "--network=host", "--user=4711", "--read-only")
    assert_relayed(host)
    assert "cannot be written, so there is no heartbeat: Read-only file system" in relay.logs()


def test_containers_of_different_users_reach_each_other_on_the_host_network(relays, containers):
    relays.run(CONFIG, "--network=host", "--user=4711")
    containers.user = 4712
    assert_relayed(containers)


def test_a_relay_shares_memory_with_nodes_of_its_own_user_on_the_host(relays, host):
    relay = relays.run(CONFIG, "--network=host", "--ipc=host", "--user=0", "--env=FASTDDS_BUILTIN_TRANSPORTS=DEFAULT")
    assert relay.shares_memory_with(assert_relayed(host).process.pid)


def test_a_relay_shares_no_memory_by_default(relays, host):
    relay = relays.run(CONFIG, "--network=host", "--ipc=host", "--user=0")
    assert not relay.shares_memory_with(assert_relayed(host).process.pid)


# This test is last: Fast DDS shares memory between processes that saw the same interfaces at their start, and a bridge
# goes down some time after its removal.
def test_containers_of_different_users_reach_each_other_on_a_bridge(bridge, relays, containers):
    relays.run(CONFIG, f"--network={bridge}", "--user=4711", *HARDENED)
    containers.user, containers.network = 4712, bridge
    assert_relayed(containers)
