"""Time that stops, jumps and begins again: no set is lost but those that a jump cuts, and none is wrong."""

import itertools

import pytest

from syncrelay.sync import ApproximateTime
from tests.faults.extent import chosen
from tests.faults.flow import accounts, wait_until_received
from tests.ros import relaying
from tests.ros.cdr_messages import CLOCK, NS_PER_SECOND, VECTOR, serialize, stamp_of, stamps_of, time, vector
from tests.ros.configs import LOSSLESS, ROOMY, config, inputs
from tests.ros.frames import Frame
from tests.ros.processes import wait_until
from tests.ros.stage import Stage
from tests.ros.status import ANY_PORT
from tests.ros.streams import BEGIN, MS, at, jittery, merged

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_PAIR = {"/camera": VECTOR, "/lidar": VECTOR}
_OUTPUTS = {f"/front{topic}": VECTOR for topic in _PAIR}
_LOOPS = chosen(short=5, long=20)
_YEAR = 365 * 24 * 3600 * NS_PER_SECOND


_GROUP = {
    "policy": "approximate_time",
    "slop": "20ms",
    "queue_size": ROOMY,
    "topics": inputs(_PAIR, qos=LOSSLESS),
}
_TEXT = config({"front": _GROUP}, metrics=ANY_PORT)


@pytest.mark.timeout(chosen(short=600, long=900))
def test_every_pass_of_a_recording_that_is_looped_gives_the_same_sets(stage: Stage, figures):
    recording = merged(
        jittery("/camera", period_ms=20, jitter_ms=4, count=200, seed=1),
        jittery("/lidar", period_ms=50, jitter_ms=4, count=80, seed=2),
    )
    relay, collector, player = stage.relay(_TEXT), stage.collector(_OUTPUTS), stage.player(_PAIR)
    relaying.connect(player, collector, recording, _OUTPUTS)
    came = {output: collector.count(output) for output in _OUTPUTS}
    policy = ApproximateTime(n_inputs=2, queue_size=ROOMY, slop_ns=20 * MS)
    # Nothing tells the end of a pass but the begin of the next: sets that still waited for something closer are cut.
    once = relaying.expected_sets(policy, recording, list(_PAIR))
    for loop in range(1, _LOOPS + 1):
        player.play(recording)
        for output in _OUTPUTS:
            collector.wait_for(output, came[output] + loop * (len(once) - 2))
    relaying.conclude(player, collector, recording, _OUTPUTS)
    columns = [collector.payloads(output)[came[output] :] for output in _OUTPUTS]
    left = list(zip(*columns, strict=True))[:-1]
    passes = _passes(left)
    assert len(passes) == _LOOPS
    for one in passes:
        assert one == once[: len(one)]
        assert len(one) >= len(once) - 2
    assert sum(each["dropped"].get("time_jump", 0) for each in accounts(relay)) >= _LOOPS - 1
    figures(f"a recording looped {_LOOPS} times: {len(left)} sets, the same {len(passes[0])} in every pass")


def _passes(sets: list[tuple[bytes, ...]]) -> list[list[tuple[bytes, ...]]]:
    passes: list[list[tuple[bytes, ...]]] = []
    newest = None
    for one in sets:
        stamp = stamp_of(one[0])
        if newest is None or stamp < newest - NS_PER_SECOND:
            passes.append([])
        newest = stamp
        passes[-1].append(one)
    return passes


class _Simulated:
    """A relay by /clock, whose sets wait 100 ms for an optional input that never speaks."""

    def __init__(self, stage: Stage) -> None:
        topics = [*inputs(_PAIR, qos=LOSSLESS), *inputs({"/imu": VECTOR}, qos=LOSSLESS, required=False)]
        group = {"policy": "approximate_time_eager", "slop": "20ms", "max_wait": "100ms", "topics": topics}
        text = config({"front": group}, metrics=ANY_PORT, node={"use_sim_time": True})
        self.relay, self.collector = stage.relay(text), stage.collector(_OUTPUTS)
        self._player = stage.player({**_PAIR, "/imu": VECTOR, "/clock": CLOCK})
        self._player.match()

    def tick(self, seconds: float) -> bool:
        """Whether it is over, as conditions ask: a tick is sent, and does not say."""
        now = BEGIN + round(seconds * NS_PER_SECOND)
        self._player.play([Frame("/clock", CLOCK, 0, serialize(CLOCK, time(now)))])
        return False

    def send(self, *seconds: float) -> None:
        """A pair of each of these stamps."""
        offsets = [1000 * each for each in seconds]
        self._player.play(merged(at("/camera", *offsets), at("/lidar", *offsets)))

    def holds(self, count: int) -> bool:
        return [each["buffered"] for each in accounts(self.relay)] == [count, count, 0]

    def wait_until_it_holds(self, count: int) -> None:
        wait_until(lambda: self.holds(count), f"{count} waiting")

    def has_left(self, seconds: float) -> bool:
        """Whether the set of this stamp is the last that has come out of every output."""
        stamp = BEGIN + round(seconds * NS_PER_SECOND)
        return all(stamps_of(self.collector.payloads(output))[-1:] == [stamp] for output in _OUTPUTS)


def test_sets_wait_by_the_clock_that_stops_and_jumps(stage: Stage):
    simulated = _Simulated(stage)
    seconds = 0

    def connected() -> bool:
        nonlocal seconds
        seconds += 1
        simulated.tick(seconds)
        simulated.send(seconds)
        simulated.tick(seconds + 0.5)
        return all(simulated.collector.count(output) for output in _OUTPUTS)

    wait_until(connected, "a first set")
    # A tick may come before the messages that were sent before it.
    ticks = (seconds + 0.5 + n / 1000 for n in itertools.count())
    wait_until(lambda: simulated.tick(next(ticks)) or simulated.has_left(seconds), "the last set of the beginning")
    # The clock stands: nothing that waits has waited any time.
    before = simulated.collector.count("/front/camera")
    simulated.send(seconds + 1, seconds + 2, seconds + 3)
    simulated.wait_until_it_holds(3)
    assert simulated.collector.count("/front/camera") == before
    # It jumps ahead: all have waited long enough. A tick may be lost.
    wait_until(lambda: simulated.tick(seconds + 3600) or simulated.has_left(seconds + 3), "the sets that waited")
    # It jumps back: what waits is of another time, and what comes then is matched as at first.
    simulated.send(seconds + 4)
    simulated.wait_until_it_holds(1)
    wait_until(lambda: simulated.tick(0) or simulated.holds(0), "nothing waiting")
    assert [each["dropped"].get("time_jump") for each in accounts(simulated.relay)] == [1, 1, None]
    simulated.send(1)
    simulated.wait_until_it_holds(1)
    wait_until(lambda: simulated.tick(2) or simulated.has_left(1), "the set of the second beginning")


def test_a_stamp_from_the_future_costs_no_more_than_what_waited_beside_it(stage: Stage, figures):
    relay, collector, player = stage.relay(_TEXT), stage.collector(_OUTPUTS), stage.player(_PAIR)
    cameras, lidars = at("/camera", *range(0, 2000, 20)), at("/lidar", *range(5, 2000, 20))
    recording = merged(cameras, lidars)
    first = relaying.connect(player, collector, recording, _OUTPUTS)
    ahead = [
        frame._replace(payload=vector(stamp_of(frame.payload) + _YEAR)) if number % 25 == 12 else frame
        for number, frame in enumerate(lidars)
    ]
    future = sum(one != other for one, other in zip(ahead, lidars, strict=True))
    # A stamp of the future and the one behind it come alone: what waits beside them must not hang on which topic lags.
    parts = [0, *(place for number in range(12, 100, 25) for place in (number, number + 2)), len(cameras)]
    for begin, end in itertools.pairwise(parts):
        player.play(merged(cameras[begin:end], ahead[begin:end]))
        wait_until_received(relay, [first + end] * 2)
    relaying.conclude(player, collector, recording, _OUTPUTS)
    right = [(camera.payload, lidar.payload) for camera, lidar in zip(cameras, lidars, strict=True)]
    sets = relaying.sets_within(recording, collector, _OUTPUTS)
    # In order and each once: what is left of the right sets when some are taken out.
    assert sets == [one for one in right if one in sets]
    assert len(sets) >= len(right) - 3 * future
    assert relay.running()
    figures(
        f"{future} stamps a year ahead among {len(recording)} messages: {len(sets)} of {len(right)} sets, none wrong"
    )
