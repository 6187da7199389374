"""The health that the engine reports for a relay, its restart after a crash, and its end in order."""

import os
import random
import signal
import time

import pytest

from tests.container.docker import HARDENED, PROBED_EVERY_SECOND, docker
from tests.container.stages import CONFIG

pytestmark = pytest.mark.container

# From the first moment to well after the start: Python's own start, the imports, joining the graph, waiting.
_RANDOM = random.Random(8)
_MOMENTS_S = [0.0, 0.02, *sorted(_RANDOM.uniform(0.05, 2.5) for _ in range(8))]
# On an idle machine it takes less than one second.
_PATIENCE_S = 20


def test_a_relay_whose_loop_is_stopped_is_unhealthy_until_it_goes_on(relays):
    relay = relays.run(CONFIG, "--network=host", "--init", *HARDENED, *PROBED_EVERY_SECOND)
    relay.wait_for_health("healthy")
    pid = relay.relay_pid()
    os.kill(pid, signal.SIGSTOP)
    relay.wait_for_health("unhealthy")
    assert "the receive loop last turned" in relay.inspect()["State"]["Health"]["Log"][-1]["Output"]
    os.kill(pid, signal.SIGCONT)
    relay.wait_for_health("healthy")


def test_a_relay_that_cannot_write_its_heartbeat_is_not_called_healthy(relays):
    # Failed probes do not count during the start period; 0 would mean the image's 20 s.
    probes = ("--health-interval=1s", "--health-retries=1", "--health-start-period=1s")
    relay = relays.run(CONFIG, "--network=host", "--read-only", *probes)
    relay.wait_for_health("unhealthy")


@pytest.mark.parametrize("below", [(), ("--init",)], ids=["as PID 1", "below an init"])
@pytest.mark.parametrize("moment_s", _MOMENTS_S, ids=lambda moment_s: f"{moment_s:.2f}s")
def test_a_container_that_is_told_to_stop_ends_in_order(relays, moment_s, below):
    relay = relays.run(CONFIG, "--network=host", *below)
    # The time is part of the case.
    time.sleep(moment_s)
    # After that docker kills it, with exit code 137.
    docker("stop", f"--time={_PATIENCE_S}", relay.id)
    assert relay.exit_code() == 0, relay.logs()
    assert "Traceback" not in relay.logs()
