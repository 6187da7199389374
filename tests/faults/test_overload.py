"""More than the relay can take: what it cannot is lost and told, what leaves is right, and then all is as before."""

import signal
import time

import pytest

from tests.faults.extent import chosen
from tests.faults.flow import MS, WAYS, Rig, accounts, go_way, without_shared_memory
from tests.faults.vitals import memory_mb
from tests.ros.processes import Process, wait_until
from tests.ros.sensors import OF_A_BUSY_MACHINE
from tests.ros.stage import Stage
from tests.ros.status import findings, first_group

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_OVERLOAD_S = chosen(short=2, long=60)
_HZ = 100
# No Python publishes so much: each source sends as fast as it can.
_MORE_THAN_ANYONE_CAN = 50_000
_HUNG_SETS = 6000
_EXPLANATIONS = {"messages_lost", "too_slow", "short_queue"}


@pytest.mark.timeout(chosen(short=600, long=600))
@pytest.mark.parametrize("way", chosen(short=WAYS[:1], long=WAYS))
def test_what_is_too_much_is_lost_in_order_and_told_and_then_all_is_as_before(stage: Stage, way: str, figures):
    rig = Rig(stage, slop=MS // 100)
    reliability = go_way(stage, way)
    relay = rig.relay()
    witness = rig.witness(reliability=reliability)
    sources = [rig.source(topic, node=topic.strip("/"), depth=1000, reliability=reliability) for topic in rig.topics]
    for source in sources:
        source.match()
        source.pace(_HZ)
    witness.wait_for_sets(_HZ)
    before = _received(relay)
    sent_before = [source.pace(_MORE_THAN_ANYONE_CAN)[0] for source in sources]
    told: set[str] = set()
    most_mb, quarter_mb = 0.0, 0.0
    began = time.monotonic()
    while (passed_s := time.monotonic() - began) < _OVERLOAD_S:
        told |= findings(relay).keys()
        most_mb = max(most_mb, memory_mb(relay.pid))
        if passed_s < _OVERLOAD_S / 4:
            quarter_mb = most_mb
    sent = sum(source.pace(_HZ)[0] for source in sources) - sum(sent_before)
    usual = time.time_ns()
    wait_until(lambda: _newest_set(relay) > usual, "usual sets")
    again_s = (time.time_ns() - usual) / 1e9
    # The witness may have to read first what had left by then.
    seen = witness.wait_for_set_after(usual)
    witness_s = (time.time_ns() - usual) / 1e9
    taken = sum(_received(relay)) - sum(before)
    assert seen.faults == []
    wait_until(lambda: bool(findings(relay).keys() & _EXPLANATIONS) or bool(told & _EXPLANATIONS), "an explanation")
    assert most_mb < quarter_mb + 50
    lost = sent - taken
    dropped = [each["dropped"] for each in accounts(relay)]
    # On a busy machine messages may wait for the relay at any time.
    wait_until(lambda: not findings(relay).keys() & (_EXPLANATIONS - OF_A_BUSY_MACHINE), "all to be as before")
    figures(
        f"{_OVERLOAD_S} s of overload ({way}): {sent / _OVERLOAD_S:,.0f} messages a second sent,"
        f" {taken / _OVERLOAD_S:,.0f} taken, {lost:,} lost before the relay; told as"
        f" {', '.join(sorted(told & _EXPLANATIONS))}; dropped {dropped}; memory {most_mb:.0f} MB at most; usual sets"
        f" leave {again_s:.1f} s after the end, as seen once a second, and {witness_s:.1f} s after it the subscriber"
        " has read its way to them"
    )


def _newest_set(relay: Process) -> int:
    """The stamp of the last set that the relay tells of."""
    sets = [each["set"] for each in first_group(relay)["recent"] if "set" in each]
    return max(sets[-1]) if sets else 0


def _received(relay: Process) -> list[int]:
    return [each["received"] for each in first_group(relay)["inputs"]]


@pytest.mark.parametrize("history", chosen(short=["keep_all"], long=["keep_all", "keep_last"]))
def test_a_subscriber_that_hangs_holds_nobody_up(stage: Stage, history: str, figures):
    without_shared_memory(stage)
    rig = Rig(stage, slop=MS // 4)
    relay = rig.relay(qos={"reliability": "reliable", "history": history})
    witness, hanging, source = rig.witness(), rig.witness(node="hanging"), rig.source()
    source.match()
    source.pace(1000)
    hanging.wait_for_sets(100)
    hanging.process.send(signal.SIGSTOP)
    # More than Fast DDS keeps for a reader that does not acknowledge.
    before = witness.report().sets
    seen = witness.wait_for_sets(_HUNG_SETS)
    hanging.process.send(signal.SIGCONT)
    again = hanging.wait_for_set_after(time.time_ns())
    assert seen.faults == again.faults == []
    accounts(relay)
    figures(f"a subscriber that hung while {seen.sets - before} sets left ({history}): the others got them as ever")
