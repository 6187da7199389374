"""configs/prometheus/alerts.yaml: promtool takes the rules, and each fires for what it names and for nothing else."""

import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from syncrelay.status import RelayState
from syncrelay.status.as_document import status_of
from syncrelay.status.metrics import exposition
from tests.top import states

_RULES = Path(__file__).parents[2] / "configs" / "prometheus" / "alerts.yaml"
_PROMTOOL = shutil.which("promtool")
pytestmark = pytest.mark.skipif(_PROMTOOL is None, reason="there is no promtool: apt-get install prometheus")


def promtool(*words: str | Path, given: str | None = None) -> str:
    """What it prints; it must be pleased."""
    ran = subprocess.run(
        [str(_PROMTOOL), *map(str, words)], input=given, capture_output=True, text=True, check=False, timeout=60
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout + ran.stderr


def metrics(state: RelayState) -> str:
    """What a relay in this state answers at /metrics."""
    return exposition(state)[0].decode()


def series(state: RelayState, growing: Sequence[str] = ()) -> list[dict[str, str]]:
    """The samples of a scrape, as they stay for ten minutes; counters of these names grow by their values."""
    lines = [line.rsplit(" ", 1) for line in metrics(state).splitlines() if not line.startswith("#")]
    named = [(name.replace("{", '{job="syncrelay",instance="robot",', 1), float(value)) for name, value in lines]
    named = [(name if "{" in name else f'{name}{{job="syncrelay",instance="robot"}}', value) for name, value in named]
    return [
        {"series": name, "values": f"{value}{f'+{value}x60' if name.startswith(tuple(growing)) else 'x60'}"}
        for name, value in named
        if "_bucket{" not in name
    ]


def alerts(folder: Path, inputs: Sequence[dict[str, str]]) -> set[tuple[str, str]]:
    """The alerts that fire after nine minutes, each with its summary."""
    folder.joinpath("rules.yaml").write_text(_RULES.read_text())
    names = [rule["alert"] for group in yaml.safe_load(_RULES.read_text())["groups"] for rule in group["rules"]]
    tested = [{"eval_time": "9m", "alertname": name, "exp_alerts": []} for name in names]
    test = {"rule_files": ["rules.yaml"], "evaluation_interval": "10s"}
    one = {"interval": "10s", "input_series": list(inputs), "alert_rule_test": tested}
    folder.joinpath("test.yaml").write_text(yaml.safe_dump({**test, "tests": [one]}))
    ran = subprocess.run(
        [str(_PROMTOOL), "test", "rules", "test.yaml"], cwd=folder, capture_output=True, text=True, check=False
    )
    # It was told to expect none, and prints those that came.
    got = ran.stdout + ran.stderr
    return {
        (name, line.split('summary="', 1)[1].split('"', 1)[0])
        for part in got.split("alertname: ")[1:]
        for name in [part.split(",", 1)[0]]
        for line in part.split("got:", 1)[1].splitlines()
        if 'summary="' in line
    }


def test_promtool_takes_the_rules_and_what_a_relay_exports():
    assert "SUCCESS: 5 rules found" in promtool("check", "rules", _RULES)
    assert "error" not in promtool("check", "metrics", given=metrics(states.rig()))


def test_nothing_fires_for_a_healthy_relay(tmp_path):
    assert alerts(tmp_path, [*series(states.healthy()), _up(1)]) == set()


def test_a_group_that_fails_and_a_relay_that_is_not_ready_are_told(tmp_path):
    assert alerts(tmp_path, [*series(states.rig()), _up(1)]) == {
        ("SyncrelayGroupFails", "robot: no sets from rear: other_clock /rear/image_raw"),
        ("SyncrelayGroupFails", "robot: no sets from inertial: short_queue /imu/data"),
        ("SyncrelayGroupFails", "robot: no sets from radar: no_publisher /radar/points"),
        ("SyncrelayNotReady", "robot: the relay is not ready"),
    }


def test_a_warning_is_told_after_a_while(tmp_path):
    state = states.without_its_optional_input()
    (group,) = status_of(state).groups
    expected = {
        ("SyncrelayGroupWarns", f"robot: front: {each.code} {each.topic or ''}")
        for each in group.findings
        if each.severity.value == "warn"
    }
    assert expected
    told = alerts(tmp_path, [*series(state), _up(1)])
    assert {each for each in told if each[0] == "SyncrelayGroupWarns"} == expected


def test_a_relay_that_has_gone_is_told(tmp_path):
    assert alerts(tmp_path, [_up(0)]) == {("SyncrelayDown", "robot: the relay cannot be asked")}


def test_losses_are_told_by_their_share(tmp_path):
    told = states.healthy()
    (report,) = told.groups
    for lost, fires in ((0, False), (200, True)):
        inputs = tuple(replace(each, graph=replace(each.graph, lost_in_all=lost)) for each in report.facts.inputs)
        state = replace(told, groups=(replace(report, facts=replace(report.facts, inputs=inputs)),))
        grown = series(state, growing=("syncrelay_messages_received", "syncrelay_messages_lost"))
        found = {text for name, text in alerts(tmp_path, [*grown, _up(1)]) if name == "SyncrelayMessagesLost"}
        topics = ("/camera/image_raw", "/lidar/points")
        assert found == ({f"robot: DDS loses more than 1 % of {topic}" for topic in topics} if fires else set())


def _up(value: int) -> dict[str, str]:
    return {"series": 'up{job="syncrelay",instance="robot"}', "values": f"{value}x60"}
