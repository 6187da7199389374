"""Hours in short: messages at a rate that the relay can bear, none of which is lost, in memory that does not grow."""

import time

import pytest

from tests.faults.extent import chosen
from tests.faults.flow import MS, Rig, accounts, wait_until_received
from tests.faults.vitals import descriptors, memory_mb
from tests.ros.configs import LOSSLESS
from tests.ros.processes import DEADLINE_S, Process, wait_until
from tests.ros.stage import Stage

pytestmark = [pytest.mark.ros, pytest.mark.faults, pytest.mark.soak]

_SOAK_S = chosen(short=4, long=900)
# Of each of four topics: together two million messages in a quarter of an hour.
_HZ = chosen(short=100, long=560)
_TOPICS = ("/camera", "/lidar", "/radar", "/imu")
# Holds what a busy machine may be late with: messages of one topic for seconds, while those of another come.
_QUEUE = 2000
_WARM_S = chosen(short=2, long=60)
# What is seen once a second grows for the first minute or so: windows, histories, the allocator's own.
_GROWTH_MB = 10


@pytest.mark.timeout(chosen(short=600, long=2400))
def test_nothing_is_lost_and_nothing_grows(stage: Stage, figures):
    rig = Rig(stage, topics=_TOPICS, slop=MS // 4)
    relay = rig.relay(qos=LOSSLESS, keys={"queue_size": _QUEUE})
    witness, source = rig.witness(), rig.source()
    source.match()
    wait_until(lambda: [len(each["subscribers"]) for each in accounts(relay)] == [1] * len(_TOPICS), "the witness")
    source.pace(_HZ)
    began = time.monotonic()
    _run_until(began + _WARM_S, relay)
    warm = memory_mb(relay.pid), descriptors(relay.pid)
    _run_until(began + _SOAK_S, relay)
    sent = source.pace(0)
    assert source.settle()
    inputs = wait_until_received(relay, sent)
    ended = memory_mb(relay.pid), descriptors(relay.pid)
    lost = sum(sent) - sum(each["received"] for each in inputs)
    # The last set may wait for something closer still.
    due = sent[0] - inputs[0]["buffered"]
    assert inputs[0]["buffered"] <= 1
    missed = due - inputs[0]["matched"]
    # A machine that starves the relay for longer than the queues hold costs sets, and the relay says so.
    assert missed == 0 or "[WARN]" in relay.stderr
    due -= missed
    assert [each["matched"] for each in inputs] == [due] * len(_TOPICS)
    witness.process.wait_until(lambda: witness.report().sets >= due, f"{due} sets")
    seen = witness.report()
    assert seen.faults == []
    assert (lost, seen.sets, seen.unpaired) == (0, due, 0)
    assert all(each["lost"] == 0 for each in inputs)
    assert ended[0] <= warm[0] + _GROWTH_MB
    # The last answer of /status may be on its way still.
    assert ended[1] <= warm[1] + 2
    figures(
        f"soak of {_SOAK_S} s: {sum(sent):,} messages, {seen.sets:,} sets, {lost} lost, {missed} sets missed;"
        f" {warm[0]:.1f} MB and {warm[1]} descriptors after {_WARM_S} s, {ended[0]:.1f} MB and {ended[1]}"
        " at the end; fed = matched + dropped + buffered for every input"
    )


def _run_until(moment_s: float, relay: Process) -> None:
    relay.wait_until(lambda: time.monotonic() >= moment_s, "its time", deadline_s=_SOAK_S + DEADLINE_S)
