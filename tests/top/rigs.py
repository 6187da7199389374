"""States of relays: simulated sensors through the real engine, observed as the relay observes it."""

import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from syncrelay.config import GroupConfig, load_text
from syncrelay.explain import Endpoint, GroupReport, GroupWatch, InputGraph, RecentDrop, Sender, judge
from syncrelay.status import Phase, RelayState
from syncrelay.sync import Match, Message

MS = 1_000_000
S = 1_000_000_000
# How long a relay takes to discover publishers.
_DISCOVERED_S = 4
_BEGAN = 1_760_000_000 * S
_RECENT = 256


@dataclass(frozen=True)
class Sensor:
    """Publishes from the start until `until_s`; stamps are `behind_ms` behind the clock, receipt `lag_ms` later.

    It publishes nothing within `gaps_ms`.
    """

    rate_hz: float
    jitter_ms: float = 1.0
    lag_ms: float = 8.0
    behind_ms: float = 0.0
    shift_ms: float = 0.0
    until_s: float = 1e9
    publishers: tuple[str, ...] = ("/driver",)
    gaps_ms: tuple[tuple[float, float], ...] = ()


def simulated(
    config: str,
    sensors: Mapping[str, Sensor],
    *,
    seconds: int = 30,
    seed: int = 1,
    node: str = "/syncrelay",
    phase: Phase = Phase.RUNNING,
) -> RelayState:
    """The state of a relay after so many seconds; a topic without a sensor has no publisher."""
    groups = tuple(_report(group, sensors, seconds, random.Random(seed)) for group in load_text(config).groups)
    return RelayState(
        node=node, config="fusion.yaml", phase=phase, uptime_s=seconds, turned_s=0.0, receives_by="rclpy", groups=groups
    )


def _report(config: GroupConfig, sensors: Mapping[str, Sensor], seconds: int, rng: random.Random) -> GroupReport:
    engine, watch = config.engine(), GroupWatch(config, began=_BEGAN)
    chosen = [sensors.get(topic.topic) for topic in config.topics]
    messages = sorted(
        (received, index, stamp)
        for index, sensor in enumerate(chosen)
        if sensor
        for received, stamp in _messages(sensor, seconds, rng)
    )
    recent: list[tuple[int | None, ...] | RecentDrop] = []
    for second in range(1, seconds + 1):
        now = _BEGAN + second * S
        arrivals: list[list[tuple[int, int]]] = [[] for _ in chosen]
        sets = []
        while messages and messages[0][0] <= now:
            received, index, stamp = messages.pop(0)
            arrivals[index].append((stamp, received))
            for outcome in [
                *engine.expire(now=received),
                *engine.add(Message(index, stamp, received, stamp), now=received),
            ]:
                if isinstance(outcome, Match):
                    stamps = outcome.stamps
                    newest = max(m.payload for m in outcome.messages if m)
                    sets.append((stamps, received - newest + rng.randrange(100_000, 400_000)))
                    recent.append(stamps)
                else:
                    recent.append(RecentDrop(outcome.message.input, outcome.message.stamp, outcome.reason))
        watch.add(arrivals, sets, engine.counts(), engine.sets, now=now)
    facts = watch.facts(
        [_graph(config, index, sensor) for index, sensor in enumerate(chosen)],
        now=_BEGAN + seconds * S,
        is_discovering=seconds < _DISCOVERED_S,
    )
    return GroupReport(facts, judge(facts), tuple(recent[-_RECENT:]))


def _messages(sensor: Sensor, seconds: int, rng: random.Random) -> Iterator[tuple[int, int]]:
    for number in range(int(min(seconds, sensor.until_s) * sensor.rate_hz)):
        at = number / sensor.rate_hz * S + sensor.shift_ms * MS + rng.gauss(0, sensor.jitter_ms) * MS
        if any(begin * MS < at < end * MS for begin, end in sensor.gaps_ms):
            continue
        taken = _BEGAN + max(0, round(at))
        lag = sensor.lag_ms * MS * rng.uniform(1, 1.2)
        yield taken + round(lag), taken - round(sensor.behind_ms * MS)


def _sender(sensor: Sensor, node: str) -> Sender:
    sent = round(10 * sensor.rate_hz)
    return Sender(node, sent, sent, sent_hz=sensor.rate_hz, way=MS, sent_in_all=sent, delivered_in_all=sent)


def _graph(config: GroupConfig, index: int, sensor: Sensor | None) -> InputGraph:
    topic = config.topics[index]
    nodes = sensor.publishers if sensor else ()
    return InputGraph(
        name=topic.topic,
        output=topic.output,
        publishers=tuple(Endpoint(name, topic.type or "") for name in nodes if sensor is not None),
        subscribers=(Endpoint("/fusion", topic.type or ""),),
        senders=tuple(_sender(sensor, name) for name in nodes if sensor is not None and sensor.rate_hz),
    )
