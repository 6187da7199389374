"""Which groups the relay evaluates: all of a few, of many some in turn, and all while somebody watches."""

from collections.abc import Iterator

import pytest

from syncrelay.config import load
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.processes import wait_until

rclpy = pytest.importorskip("rclpy", reason="rclpy is not installed")
own_relay = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed").own_relay

pytestmark = pytest.mark.ros

_GROUPS = 12


@pytest.fixture
def relay_of(ros_domain: int, tmp_path, monkeypatch) -> Iterator:
    """Start a relay of this process whose file has these keys."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    started = []

    def start(n_groups, **keys):
        started.append(own_relay(_loaded(tmp_path, [f"g{n}" for n in range(n_groups)], **keys)))
        return started[-1].__enter__()

    yield start
    for relay in started:
        relay.close()


def _loaded(folder, names, **keys):
    group = {"policy": "exact_time", "topics": inputs({"/a": VECTOR, "/b": VECTOR})}
    path = folder / "groups.yaml"
    path.write_text(config(dict.fromkeys(names, group), metrics=None, **keys))
    return load(str(path))


def _evaluated_at(relay):
    """When each group was evaluated last."""
    return {report.facts.name: report.facts.figures.now for report in relay.monitor.reports}


def _evaluated_next(relay):
    """Names of those that the relay evaluates next."""
    before = _evaluated_at(relay)
    wait_until(lambda: relay.step() or _evaluated_at(relay) != before, "an evaluation")
    return [name for name, seen in _evaluated_at(relay).items() if seen != before.get(name)]


@pytest.mark.parametrize(("n_groups", "at_a_time", "turns"), [(10, 10, 1), (_GROUPS, 10, 2), (61, 16, 4)])
def test_all_of_a_few_and_some_of_many_are_evaluated_at_a_time_and_none_is_left_out(
    relay_of, n_groups, at_a_time, turns
):
    relay = relay_of(n_groups)
    assert len(_evaluated_next(relay)) == n_groups
    evaluated = [_evaluated_next(relay) for _ in range(turns)]
    assert [len(names) for names in evaluated] == [at_a_time] * turns
    assert set().union(*evaluated) == set(_evaluated_at(relay))


def test_whoever_asks_for_the_state_sees_all_as_they_are(relay_of, monkeypatch):
    # However long the next evaluation takes to come.
    monkeypatch.setattr("syncrelay.relay.relay._ASKED_S", 600.0)
    relay = relay_of(_GROUPS)
    _evaluated_next(relay)
    assert len(_evaluated_next(relay)) == 10
    relay.state()
    assert len(_evaluated_next(relay)) == _GROUPS


def test_whoever_plots_them_sees_all_as_they_are(relay_of):
    relay = relay_of(_GROUPS, diagnostics={"scalars": True})
    assert [len(_evaluated_next(relay)) for _ in range(3)] == [_GROUPS] * 3


def test_groups_that_a_reload_brings_are_evaluated_at_once(relay_of, tmp_path):
    relay = relay_of(_GROUPS)
    _evaluated_next(relay)
    names = [*_evaluated_at(relay), "new"]
    relay.reload(_loaded(tmp_path, names))
    assert "new" in _evaluated_next(relay)
    assert list(_evaluated_at(relay)) == names


def test_a_report_stands_until_the_next_one_is_there(relay_of, monkeypatch):
    relay = relay_of(3)
    _evaluated_next(relay)
    evaluate, there = relay.monitor._evaluate_group, []  # noqa: SLF001  no other moment is within an evaluation

    def noted(*of):
        there.append(len(_evaluated_at(relay)))
        return evaluate(*of)

    monkeypatch.setattr(relay.monitor, "_evaluate_group", noted)
    _evaluated_next(relay)
    assert there == [3] * 3


def test_a_group_that_cannot_be_evaluated_is_named_and_its_last_report_is_gone(relay_of, monkeypatch, caplog):
    relay = relay_of(2)
    _evaluated_next(relay)
    assert relay.state().unjudged == ()
    evaluate = relay.monitor._evaluate_group  # noqa: SLF001  as above

    def failing(binding, *of):
        return evaluate(binding, *of) if binding.group.config.name == "g1" else dict[str, object]()["no rate"]

    monkeypatch.setattr(relay.monitor, "_evaluate_group", failing)
    for _ in range(2):
        relay.evaluate()
        assert (relay.state().unjudged, list(_evaluated_at(relay))) == (("g0",), ["g1"])
    assert caplog.text.count("a bug in syncrelay while evaluating g0; the relay keeps running") == 1
