"""One cause is one line, however many groups it hits: rigs of groups, nodes and silent sensors, drawn at random."""

import random
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import pytest

from syncrelay.explain import CauseLog, Code, Endpoint, Finding, GroupFacts, Severity
from syncrelay.explain.cause_log import Line
from syncrelay.explain.codes import OF_RELAY
from syncrelay.explain.finding_log import Remark
from tests.explain.scenario import S, Source, run
from tests.explain.support.groups import a_group, an_input
from tests.faults.extent import chosen

_SEEDS = range(chosen(short=3, long=300))
_FALLS_SILENT_S = 14.0
_IS_BACK_S = 40.0
_SECONDS = 75


@dataclass(frozen=True)
class _Rig:
    """Nodes with their topics, groups with the topics that they use, and what falls silent.

    `gone` are those of the nodes with silent topics that leave the graph.
    """

    nodes: dict[str, tuple[str, ...]]
    groups: dict[str, tuple[str, ...]]
    silent: frozenset[str]
    gone: frozenset[str]

    def node_of(self, topic: str) -> str:
        return next(node for node, topics in self.nodes.items() if topic in topics)

    def hit_by(self, node: str) -> set[str]:
        topics = self.silent & set(self.nodes[node])
        return {name for name, used in self.groups.items() if topics & set(used)}

    @property
    def causes(self) -> set[str]:
        return {node for node in self.nodes if self.hit_by(node)}


def _drawn(seed: int) -> _Rig:
    chance = random.Random(seed)
    nodes = {
        # Some have their name in their topics, which is not to be taken for it.
        f"/node_{number}": tuple(
            f"{chance.choice([f'/node_{number}', f'/sensor_{number}'])}/topic_{place}"
            for place in range(chance.randint(1, 5))
        )
        for number in range(chance.randint(2, 6))
    }
    topics = [topic for of_node in nodes.values() for topic in of_node]
    groups = {
        f"group_{number}": tuple(chance.sample(topics, min(len(topics), chance.randint(2, 4))))
        for number in range(chance.randint(1, 14))
    }
    ill = chance.sample([*nodes], chance.randint(1, min(3, len(nodes) - 1)))
    gone = frozenset(node for node in ill if chance.random() < 0.3)
    silent = {
        topic
        for node in ill
        for topic in (nodes[node] if node in gone else chance.sample(nodes[node], chance.randint(1, len(nodes[node]))))
    }
    return _Rig(nodes, groups, frozenset(silent), gone)


def _played(rig: _Rig, seed: int) -> list[tuple[float, Line]]:
    """What a relay of these groups would log, looking at ten of them at a time."""
    heard: list[tuple[float, str, GroupFacts, tuple[Finding, ...], list[Remark]]] = []
    turns = -(-len(rig.groups) // 10)
    for place, (name, topics) in enumerate(rig.groups.items()):

        def hear(
            second: float, facts: GroupFacts, found: tuple[Finding, ...], remarks: list[Remark], name: str = name
        ) -> None:
            heard.append((second, name, replace(facts, name=name), found, remarks))

        run(
            *(_source(rig, topic) for topic in topics),
            seconds=_SECONDS,
            seed=seed,
            options={"slop": "60ms"},
            publishers=lambda topic, second: _publishers(rig, topic, second),
            looks=[second for second in range(1, _SECONDS) if second % turns == place % turns],
            hears=hear,
        )
    log, lines = CauseLog(), list[tuple[float, Line]]()
    log.watch(rig.groups)
    for second, looks in groupby(sorted(heard, key=lambda each: each[0]), key=lambda each: each[0]):
        for _, _, facts, found, remarks in looks:
            log.hear(facts, found, remarks, now=round(second * S))
        lines += [(second, line) for line in log.lines(now=round(second * S))]
    return lines


def _source(rig: _Rig, topic: str) -> Source:
    return Source(
        topic,
        hz=5,
        phase_ms=3 * len(topic),
        node=rig.node_of(topic),
        sends=lambda second: topic not in rig.silent or not _FALLS_SILENT_S <= second < _IS_BACK_S,
    )


def _publishers(rig: _Rig, topic: str, second: float) -> tuple[Endpoint, ...]:
    node = rig.node_of(topic)
    is_gone = node in rig.gone and _FALLS_SILENT_S <= second < _IS_BACK_S
    return () if is_gone else (Endpoint(node, "sensor_msgs/msg/Imu"),)


def _warnings(lines: Sequence[tuple[float, Line]]) -> Iterator[tuple[float, Line, str]]:
    """The lines about causes, and the node that each names."""
    for second, line in lines:
        if line.severity:
            yield second, line, next(iter(re.findall(r"/node_\d+(?![\w/])", line.text)), "nobody")


@pytest.mark.parametrize("seed", _SEEDS)
def test_each_cause_is_one_line_that_names_its_node_and_counts_its_groups(seed: int):
    rig = _drawn(seed)
    lines = _played(rig, seed)
    case = f"seed {seed}: {rig}\n" + "\n".join(f"{second:g} {line.text}" for second, line in lines)
    told = [*_warnings(lines)]
    if _is_all_silent(rig):
        assert len({second for second, _, _ in told}) == len(told) <= 3, case
        return
    # The first line of each node; a silence that goes on is said again ever less often.
    first = {node: line for _, line, node in reversed(told)}
    assert first.keys() == rig.causes, case
    for node, line in first.items():
        assert set(line.groups) == rig.hit_by(node), case
        count = len(rig.hit_by(node))
        assert line.text.startswith(f"{count} groups (" if count > 1 else f"{line.groups[0]}: "), case
    for node in rig.causes:
        seconds = [second for second, _, each in told if each == node]
        assert len(seconds) <= 3, case
        assert all(later - sooner >= 4 for sooner, later in pairwise(seconds)), case
    # That it is over is one line for each cause too.
    over = [line for _, line in lines if not line.severity]
    assert len(over) <= len(rig.causes), case
    assert {group for line in over for group in line.groups} == {
        group for node in rig.causes for group in rig.hit_by(node)
    }, case


def _is_all_silent(rig: _Rig) -> bool:
    """Whether nothing comes from anybody, which has one cause: the network, or who plays a recording."""
    used = {topic for topics in rig.groups.values() for topic in topics}
    return used <= rig.silent and len({rig.node_of(topic) for topic in used}) > 1 and not rig.gone


@pytest.mark.parametrize("code", sorted(OF_RELAY, key=str))
@pytest.mark.parametrize("about", [None, 0])
def test_a_cause_of_the_relay_is_one_line_for_all_groups_unless_it_is_about_an_input(code: Code, about: int | None):
    log = CauseLog()
    log.watch(["front", "rear"])
    found = Finding(code, Severity.WARN, "so it is", input=about)
    for name in ("front", "rear"):
        camera = an_input(f"/{name}/camera", node=f"/{name}_driver")
        log.hear(a_group(camera, name=name), (found,), [Remark(Severity.WARN, "so it is", (found,))], now=S)
    lines = [line.text for line in log.lines(now=7 * S)]
    assert len(lines) == (1 if about is None else 2)
    assert about is not None or lines[0] == "2 groups (front and rear): so it is"


def _heard(log: CauseLog, second: int, *warned: str) -> list[str]:
    """What the log says after both groups were judged, of which these warn of the driver that they share."""
    found = Finding(Code.DUPLICATES, Severity.WARN, "stamps repeat", input=0)
    for name in ("front", "rear"):
        remarks = [Remark(Severity.WARN, found.text, (found,))] if name in warned else []
        log.hear(a_group(an_input("/camera"), name=name), (found,), remarks, now=second * S)
    return [line.text for line in log.lines(now=second * S + 1)]


@pytest.mark.parametrize("is_over", [True, False])
def test_a_cause_is_news_again_after_a_minute_unless_another_group_has_it_still(is_over):
    log = CauseLog()
    log.watch(["front", "rear"])
    seconds = [second for second in range(1, 190) if _heard(log, second, "front", "rear")]
    assert seconds == [2, 6, 16, 36, 76, 156]
    if is_over:
        found = Finding(Code.DUPLICATES, Severity.WARN, "stamps repeat", input=0)
        log.hear(a_group(an_input("/camera"), name="front"), (), [Remark(Severity.OK, "over", (found,))], now=190 * S)
        assert [line.text for line in log.lines(now=190 * S, is_last=True)] == ["front: over"]
    assert not _heard(log, 200)
    assert [second for second in range(260, 300) if _heard(log, second, "rear")] == (
        [261, 265, 275, 295] if is_over else []
    )
