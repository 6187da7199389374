"""What dropped messages cost sets, and what views say of the others: of counts and rigs whose truth was drawn."""

import random
from dataclasses import dataclass

import pytest

from syncrelay.explain import FOR_WANT_OF_A_PARTNER, RecentDrop, Standing, drop_fates
from syncrelay.explain.summary import summarize
from syncrelay.explain.unneeded import may_set_pace
from syncrelay.status import RelayState
from syncrelay.status.as_document import status_of
from syncrelay.sync import DropReason
from syncrelay.top.group_blocks import recent_sets
from syncrelay.top.plain import group_lines
from tests.faults.extent import chosen
from tests.top.rigs import Sensor, simulated
from tests.top.states import CLOUD, IMAGE, file, group

_COUNTS = chosen(short=80, long=20_000)
_RIGS = chosen(short=3, long=400)
_WANTING = sorted(FOR_WANT_OF_A_PARTNER, key=str)
_OTHERS = sorted(set(DropReason) - FOR_WANT_OF_A_PARTNER - {DropReason.LATE}, key=str)


def _drawn(chance: random.Random, count: int, reasons: list[DropReason]) -> dict[DropReason, int]:
    drops: dict[DropReason, int] = {}
    for _ in range(count):
        reason = chance.choice(reasons)
        drops[reason] = drops.get(reason, 0) + 1
    return drops


def test_no_more_drops_are_costly_than_sets_were_missed():
    for seed in range(_COUNTS):
        chance = random.Random(f"unneeded {seed}")
        required = [True, *(chance.random() < 0.8 for _ in range(chance.randrange(1, 4)))]
        missed = chance.choice([0, 0, 1, 3, 20])
        surplus = [0, *(chance.choice([0, 1, 50]) for _ in required[1:])]
        # Of the slowest input some were late: the sets were missed all the same.
        late = chance.randrange(missed + 1)
        faults = [_drawn(chance, chance.choice([0, 4]), _OTHERS) for _ in required]
        wanting = [_drawn(chance, missed + more - (late if not at else 0), _WANTING) for at, more in enumerate(surplus)]
        dropped = [{**fault, **want} for fault, want in zip(faults, wanting, strict=True)]
        if late:
            dropped[0][DropReason.LATE] = late
        order = chance.sample(range(len(required)), len(required))
        counted = may_set_pace([place for place, at in enumerate(order) if required[at]], trigger=None, by_clock=False)
        found = dict(zip(order, drop_fates([dropped[at] for at in order], counted), strict=True))
        for at, fates in found.items():
            told = f"seed {seed}, input {at} of {dropped}, {missed} missed: {fates}"
            assert fates.unneeded == surplus[at], told
            assert {why: n for why, n in fates.others.items() if why not in FOR_WANT_OF_A_PARTNER} == {
                why: n for why, n in dropped[at].items() if why not in FOR_WANT_OF_A_PARTNER
            }, told
            assert all(0 < n <= dropped[at][why] for why, n in fates.others.items()), told
            assert bool(fates.lacking) or at == order[counted[0]] or not fates.unneeded, told


def test_where_a_clock_makes_the_sets_only_what_gave_way_to_a_newer_message_is_not_needed():
    dropped = [{DropReason.SUPERSEDED: 20, DropReason.EXPIRED: 3}, {DropReason.EXPIRED: 1}]
    fates, other = drop_fates(dropped, may_set_pace((True, True), trigger=None, by_clock=True))
    assert (fates.unneeded, fates.others, other.unneeded) == (20, {DropReason.EXPIRED: 3}, 0)


@dataclass(frozen=True)
class Rig:
    """A camera and a slow lidar. So many of the lidar's messages have no partner: the camera pauses round them."""

    seed: int
    alone: int
    how: str
    state: RelayState


def rig(seed: int, *, alone: int) -> Rig:
    chance = random.Random(f"surplus {seed}")
    lidar_hz, times = chance.choice([4, 5, 8, 10]), chance.choice([2, 3, 5, 10])
    camera_hz = lidar_hz * times * chance.uniform(1, 1.1)
    slop_ms = 1000 / camera_hz * chance.uniform(0.7, 0.9)
    seconds = chance.choice([10, 20])
    begin_ms = 1000 / camera_hz + chance.uniform(5, 100)
    policy = chance.choice(["approximate_time", "approximate_time_eager", "approximate_epsilon_time"])
    numbers = chance.sample(range(4, lidar_hz * (seconds - 3), 2), alone)
    centres = [begin_ms + number / lidar_hz * 1000 for number in numbers]
    camera = Sensor(camera_hz, jitter_ms=0.3, gaps_ms=tuple((at - slop_ms - 5, at + slop_ms + 5) for at in centres))
    lidar = Sensor(lidar_hz, jitter_ms=0.3, lag_ms=chance.uniform(1, 60), shift_ms=begin_ms)
    config = file(front=group({"/camera": IMAGE, "/lidar": CLOUD}, policy=policy, slop=f"{slop_ms}ms", queue_size=30))
    how = f"seed {seed}, {policy}: camera {camera_hz:.3g} Hz, lidar {lidar_hz} Hz, slop {slop_ms:.3g} ms, {seconds} s"
    state = simulated(config, {"/camera": camera, "/lidar": lidar}, seconds=seconds, seed=seed)
    return Rig(seed, alone, f"{how}, {alone} alone", state)


@pytest.mark.parametrize("seed", range(_RIGS))
def test_surplus_of_a_faster_camera_is_not_needed_in_any_view(seed):
    drawn = rig(seed, alone=0)
    (report,) = drawn.state.groups
    told = status_of(drawn.state).as_dict()
    camera, lidar = told["groups"][0]["inputs"]
    surplus = camera["received"] - camera["matched"] - camera["buffered"]
    assert lidar["matched"] + lidar["buffered"] == lidar["received"], drawn.how
    assert (camera["unneeded"], camera["other_drops"], camera["other_drops_lately"]) == (surplus, {}, {}), drawn.how
    assert camera["unneeded_lately"] == sum(camera["dropped_lately"].values()) > 0, drawn.how
    drops = [each["drop"] for each in told["groups"][0]["recent"] if "drop" in each]
    assert drops, drawn.how
    assert all(each["unneeded"] for each in drops), drawn.how
    assert report.told(RecentDrop(0, 1, DropReason(drops[0]["reason"]))).unneeded
    assert report.facts.standing is Standing.ENOUGH, drawn.how
    (shown,) = status_of(drawn.state).groups
    text = "\n".join(group_lines(shown, width=1000))
    assert f"waiting, {surplus} not needed, 0 dropped" in text, drawn.how
    strip = list(recent_sets(shown, 160))
    assert not any("red" in str(span.style) for line in strip for span in line.spans), drawn.how
    assert any("· not needed" in line.plain for line in strip), drawn.how
    lines = summarize("front", 0, [(each.name, each.counts) for each in report.facts.inputs], report.facts.fates)
    assert f", {surplus} not needed (no message of /lidar left to pair with), 0 dropped" in "\n".join(lines), drawn.how
    for reason in FOR_WANT_OF_A_PARTNER:
        assert reason.value not in text, drawn.how


@pytest.mark.parametrize("seed", range(_RIGS))
def test_each_message_of_a_lidar_without_a_partner_is_costly_and_no_more(seed):
    drawn = rig(seed, alone=random.Random(seed).randrange(1, 6))
    told = status_of(drawn.state).as_dict()
    camera, lidar = told["groups"][0]["inputs"]
    assert lidar["unneeded"] == 0, drawn.how
    assert sum(lidar["other_drops"].values()) == drawn.alone, drawn.how
    assert sum(camera["other_drops"].values()) <= drawn.alone, drawn.how
    for each in (camera, lidar):
        drops = sum(each["dropped"].values())
        assert each["received"] == each["matched"] + each["buffered"] + drops, drawn.how
        assert each["unneeded"] + sum(each["other_drops"].values()) == drops, drawn.how
    recent = [each["drop"] for each in told["groups"][0]["recent"] if "drop" in each]
    assert not any(each["unneeded"] for each in recent if each["input"] == 1), drawn.how


@pytest.mark.parametrize("seed", range(_RIGS))
def test_no_drop_is_shown_as_not_needed_where_each_may_be_why_no_set_leaves(seed):
    chance = random.Random(f"apart {seed}")
    lidar_hz = chance.choice([4, 5, 8, 10])
    camera_hz = lidar_hz * chance.choice([1, 2, 3, 10])
    config = file(front=group({"/camera": IMAGE, "/lidar": CLOUD}, queue_size=chance.choice([5, 20])))
    camera = Sensor(camera_hz, behind_ms=chance.choice([-1, 1]) * chance.uniform(6000, 50_000))
    state = simulated(config, {"/camera": camera, "/lidar": Sensor(lidar_hz)}, seconds=20, seed=seed)
    told = status_of(state).as_dict()["groups"][0]
    how = f"seed {seed}, camera {camera_hz} Hz {camera.behind_ms:.0f} ms behind, lidar {lidar_hz} Hz"
    assert not any(each["drop"]["unneeded"] for each in told["recent"]), how
    assert all(each["other_drops_lately"] for each in told["inputs"]), how
