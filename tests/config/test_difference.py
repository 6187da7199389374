"""What a reload would do, key by key; what the relay does with it is in tests/ros/test_reload.py."""

import random
from dataclasses import replace

import pytest

from syncrelay.config import load_text
from syncrelay.config.difference import Difference, KeyChange, difference
from syncrelay.config.reload import exchange
from tests.config.test_together import file, group
from tests.drawn_files import any_file

FRONT, REAR = group("front", "/a", "/b"), group("rear", "/a", "/c")


def between(old: str, new: str, environ: dict[str, str]) -> Difference:
    return difference(load_text(old, environ=environ), load_text(new, environ=environ))


def keys(old: str, new: str, environ: dict[str, str]) -> list[tuple[str, str | None, str | None]]:
    """The keys that change in the one group that does."""
    (change,) = between(old, new, environ).groups
    return [(f"{each.topic or ''} {each.key}".strip(), each.old, each.new) for each in change.keys]


def test_a_group_that_a_bug_stopped_is_rebuilt_though_its_keys_are_the_same(environ):
    groups = load_text(file(FRONT, REAR), environ=environ).groups
    assert exchange(groups, groups, stopped=["rear"]).rebuilt == ("rear",)


@pytest.mark.parametrize(
    ("top", "restart", "sections"),
    [
        ("node: {name: other}", ("node",), [KeyChange("node.name", None, "other")]),
        ("metrics: null", ("metrics",), [KeyChange("metrics", None, "null")]),
        ("metrics: {listen: '127.0.0.1:0'}", ("metrics",), [KeyChange("metrics.listen", None, "127.0.0.1:0")]),
        ("diagnostics: {scalars: true}", (), [KeyChange("diagnostics.scalars", None, "true")]),
    ],
)
def test_what_is_no_group_is_told_and_whether_it_needs_a_restart(top, restart, sections, environ):
    found = between(file(FRONT), file(FRONT, top=f"{top}\n"), environ)
    assert (found.restart, list(found.sections), found.is_empty) == (restart, sections, False)
    back = between(file(FRONT, top=f"{top}\n"), file(FRONT), environ)
    assert list(back.sections) == [replace(each, old=each.new, new=each.old) for each in sections]


def test_keys_of_the_users_own_are_not_told_and_values_stay_on_one_line(environ):
    def of(slop, depth, note):
        return file(
            f"  front:\n    policy: approximate_time\n    slop: {slop}\n    topics:\n"
            f'    - {{topic: /a, type: sensor_msgs/msg/Imu, qos: {{depth: {depth}, x-note: "{note}"}}}}\n'
            "    - {topic: /b, type: sensor_msgs/msg/Imu}\n"
        )

    assert keys(of('"\\n20ms"', 4, "\\e[2J"), of('"\\r\\n30ms"', 5, "\\nforged"), environ) == [
        ("slop", "\\n20ms", "\\r\\n30ms"),
        ("/a qos", "{depth: 4}", "{depth: 5}"),
    ]
    assert between(of("20ms", 4, "one"), of("20ms", 4, "other"), environ).is_empty


@pytest.mark.parametrize("seed", range(20))
def test_of_any_two_files_all_that_changes_is_told_and_nothing_else(seed: int):
    """What a group is built of, and each section, changes if and only if something is told of it."""
    chance = random.Random(seed)
    (_, old), (_, new) = (any_file(chance) for _ in range(2))
    found = difference(old, new)
    before = {group.name: group for group in old.groups}
    rebuilt = [group.name for group in new.groups if group.name in before and group != before[group.name]]
    assert [change.name for change in found.groups] == rebuilt
    told = [change for change in found.groups if change.keys or change.removed or change.added or change.reordered]
    # Where the node changes, names do that are written as they were.
    assert found.restart or told == list(found.groups)
    assert all(len({(key.topic, key.key) for key in group.keys}) == len(group.keys) for group in told)
    assert all(each.old != each.new for each in (*found.sections, *(key for group in told for key in group.keys)))
    sections = {each.key.partition(".")[0] for each in found.sections}
    pairs = {name: (getattr(old, name), getattr(new, name)) for name in ("node", "listen", "diagnostics")}
    changed = {name for name, (was, is_now) in pairs.items() if was != is_now}
    assert sections == {"metrics" if name == "listen" else name for name in changed}
    assert difference(old, old).is_empty
