"""A relay in a container ends in order after SIGTERM at any moment of its start, as PID 1 and below an init."""

import random
import time

import pytest

from tests.container.docker import docker
from tests.container.sets import CONFIG

pytestmark = pytest.mark.container

# From the first moment to well after the start: Python's own start, the imports, joining the graph, waiting.
_RANDOM = random.Random(8)
_MOMENTS_S = [0.0, 0.02, *sorted(_RANDOM.uniform(0.05, 2.5) for _ in range(8))]
# On an idle machine it takes less than one second.
_PATIENCE_S = 20


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


def test_a_control_c_at_a_container_ends_it_in_order(relays):
    relay = relays.run(CONFIG, "--network=host")
    relay.wait_for_log("front: waiting for")
    docker("kill", "--signal=INT", relay.id)
    assert relay.exit_code() == 0
    assert "front: 0 sets" in relay.logs()
