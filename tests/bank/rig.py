"""Drawn rigs: what each input sends, and when it comes; of each message it is known when its sample was taken."""

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from syncrelay.config.profile import Mismatch
from syncrelay.explain import Endpoint
from tests.explain.scenario import BEGAN, IMU, S

Times = npt.NDArray[np.int64]

LONGEST_S: Final = 75.0
_TOPICS: Final = ("/camera", "/lidar", "/imu")
# No matching needs the last of what comes so closely, and a draw should not take longer than a second of CPU.
_MOST_HZ: Final = 1000.0
_MOST_MESSAGES_A_SECOND: Final = 1500.0
# Some sensors start after the relay, by up to so many seconds, and DDS shows them at some time around that.
_START_LATE: Final = 0.3
_LATEST_S: Final = 6.0
_LEAD_S: Final = (-1.0, 3.0)


@dataclass
class Flow:
    """What one publisher sends on one topic: nanoseconds after the start, stamps by the machine's clock."""

    topic: str
    hz: float
    true: Times
    """When each sample was taken."""
    stamps: Times
    received: Times
    lateness: float
    """The usual time from a sample to its receipt, and the mean of what varies of it, in nanoseconds."""
    jitter: float
    node: str = ""
    required: bool = True
    starts: float = 0.0
    """When its first sample is taken: 0 if it was sending before the relay came."""
    found: float = 0.0
    """When the graph first shows its publisher."""
    is_cut: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    shown: Callable[[float], bool] = lambda _: True
    mismatch: Mismatch | None = None
    type: str = IMU
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def period(self) -> int:
        return round(S / self.hz)

    @property
    def endpoint(self) -> Endpoint:
        return Endpoint(self.node or f"{self.topic}_driver", self.type, self.mismatch)

    def keep(self, which: npt.NDArray[np.bool_]) -> None:
        """Lose all other messages."""
        self.true, self.stamps, self.received = self.true[which], self.stamps[which], self.received[which]
        if len(self.is_cut):
            self.is_cut = self.is_cut[which]

    def is_shown(self, second: float) -> bool:
        """Whether the graph shows its publisher."""
        return second >= self.found and self.shown(second)

    def since(self, second: float) -> npt.NDArray[np.bool_]:
        """Which samples were taken from this second on."""
        return self.true >= round(second * S)

    def messages(self) -> list[tuple[float, int | None]]:
        order = np.argsort(self.received, kind="stable")
        cut = self.is_cut if len(self.is_cut) else np.zeros(len(order), dtype=np.bool_)
        return [
            (at / S, None if is_cut else stamp)
            for at, stamp, is_cut in zip(
                self.received[order].tolist(), self.stamps[order].tolist(), cut[order].tolist(), strict=True
            )
        ]


@dataclass
class Rig:
    """A group and its flows; without a fault all its sets leave."""

    chance: random.Random
    flows: list[Flow]
    width: int
    """The span of the widest set of messages of one moment, in nanoseconds."""
    slop: int
    options: dict[str, Any]
    begin: float = 0.0
    """When the fault begins: 0 if it was there before the relay came."""
    began: int = BEGAN
    """Second 0 by the machine's clock."""
    stops: list[tuple[float, float]] = field(default_factory=list)

    @property
    def starts(self) -> float:
        """When the last of its sensors has started."""
        return max(each.starts for each in self.flows)

    @property
    def slowest(self) -> int:
        return max(each.period for each in self.flows)

    def seen(self, after: float = 0.0, periods: int = 5) -> float:
        """The second at which so many messages of the slowest input show what began `after` the fault."""
        return self.begin + after + periods * self.slowest / S

    @property
    def rng(self) -> np.random.Generator:
        return np.random.default_rng(self.chance.randrange(2**32))


def spans(
    rig: Rig, flows: list[Flow] | None = None, *, by: Callable[[Flow], Times] = lambda each: each.stamps
) -> Times:
    """The span of the nearest set of each message of the slowest input, by stamps; of those that are whole."""
    flows = flows or rig.flows
    if not all(len(by(each)) for each in flows):
        return np.zeros(0, dtype=np.int64)
    pivot = max(flows, key=lambda each: each.period)
    stamps = by(pivot)
    low, high = stamps.copy(), stamps.copy()
    inside = np.ones(len(stamps), dtype=np.bool_)
    for other in (each for each in flows if each is not pivot):
        theirs = np.sort(by(other))
        at = np.clip(np.searchsorted(theirs, stamps), 1, max(1, len(theirs) - 1))
        before, after = theirs[at - 1], theirs[np.minimum(at, len(theirs) - 1)]
        nearest = np.where(stamps - before <= after - stamps, before, after)
        inside &= (stamps >= theirs[0]) & (stamps <= theirs[-1])
        low, high = np.minimum(low, nearest), np.maximum(high, nearest)
    found: Times = (high - low)[inside]
    return found


def a_rig(
    chance: random.Random, policy: str, *, same_rate: bool = False, seconds: float = LONGEST_S, began: int = BEGAN
) -> Rig:
    """Draw a rig that is well."""
    n_inputs = chance.choice([2, 2, 2, 3, 3])
    slow_hz = min(100.0, 10 ** chance.uniform(-0.7, 2.2))
    most = min(_MOST_HZ, _MOST_MESSAGES_A_SECOND) / slow_hz
    ratios = [
        1 if same_rate or policy == "exact_time" else min(most, chance.choice([1, 1, 1, 2, 3, 10, 30]))
        for _ in range(n_inputs)
    ]
    ratios[chance.randrange(n_inputs)] = 1
    rng = np.random.default_rng(chance.randrange(2**32))
    is_triggered = policy == "exact_time" or chance.random() < 0.5
    wobble = 0.0 if policy == "exact_time" else chance.choice([0.0, 10 ** chance.uniform(-3, -1.5)])
    flows = []
    for topic, ratio in zip(_TOPICS, ratios, strict=False):
        hz = slow_hz * ratio
        period = S / hz
        phase = 0.0 if is_triggered else chance.uniform(0, 0.35) * period
        ppm = 0.0 if is_triggered else chance.uniform(-20, 20) * 1e-6
        count = int(seconds * hz) + 1
        true = (
            0.2 * S / slow_hz
            + phase
            + np.arange(count) * period * (1 + ppm)
            + rng.normal(0, 1, count) * wobble * period
        )
        if is_triggered and wobble == 0 and ratio == 1:
            true = np.round(true)
        flows.append(_flow(chance, rng, topic, hz, true.astype(np.int64), began=began))
    rig = Rig(chance, flows, 0, 0, {}, began=began)
    rig.width = int(spans(rig).max(initial=0))
    rig.slop = max(round(rig.width * chance.uniform(1.2, 3)), chance.choice([1_000_000, 5_000_000, 10_000_000]))
    if chance.random() < 0.3:
        for each in flows:
            each.keep(rng.random(len(each.true)) >= chance.uniform(0, 0.02))
    rig.options = _options(rig, policy)
    _start(rig)
    return rig


def _start(rig: Rig) -> None:
    """Draw when the sensors start: before the relay, or after it, all at once or one by one."""
    chance = rig.chance
    if chance.random() >= _START_LATE:
        return
    at_once = chance.choice([None, chance.uniform(0, _LATEST_S)])
    for each in rig.flows:
        each.starts = chance.uniform(0, _LATEST_S) if at_once is None else at_once
        each.found = max(0.0, each.starts - chance.choice([0.1, chance.uniform(*_LEAD_S)]))


def without_what_was_before_the_start(rig: Rig) -> None:
    """Have no sensor send before it has started."""
    for each in rig.flows:
        if each.starts:
            each.keep(each.since(each.starts))


def _flow(chance: random.Random, rng: np.random.Generator, topic: str, hz: float, true: Times, *, began: int) -> Flow:
    delay = min(10 ** chance.uniform(-0.5, 2), 400 / hz) * 1_000_000
    jitter = min(10 ** chance.uniform(-2, 1.3), 200 / hz) * 1_000_000
    shape = chance.choice([1.0, 1.0, 2.0])
    late = delay + rng.gamma(shape, jitter / shape, len(true))
    received = np.maximum.accumulate((true + late).astype(np.int64))
    return Flow(topic, hz, true, true + began, received, delay + jitter, jitter)


def _options(rig: Rig, policy: str) -> dict[str, Any]:
    late = [each.lateness + 6 * each.jitter for each in rig.flows]
    fastest = max(each.hz for each in rig.flows)
    needed = (max(late) - min(late) + 2.5 * rig.slowest) / S * fastest
    queue_size = max(rig.chance.choice([10, 20]), int(1.5 * needed) + 3)
    options: dict[str, Any] = {"policy": policy, "queue_size": queue_size}
    if policy == "latest_time":
        options["trigger"] = max(rig.flows, key=lambda each: each.period).topic
        oldest = max(each.period for each in rig.flows)
        options["max_age"] = f"{round(1.3 * oldest + 0.2 * S)}ns"
        options["max_wait"] = f"{round(max(late) + rig.slowest / 4) // 1000 + 1}us"
    elif policy != "exact_time":
        options["slop"] = f"{rig.slop}ns"
    return options
