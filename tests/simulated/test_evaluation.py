"""Which groups the relay evaluates: all of a few, of many some in turn, and all while somebody watches."""

from collections.abc import Callable, Iterator

import pytest

pytest.importorskip("rclpy", reason="rclpy is not installed")

from syncrelay.config import Config, load_text
from syncrelay.relay.relay import Relay
from tests.conformance.simulated import SimulatedWorld
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs

_NAMES = [f"g{n}" for n in range(12)]


@pytest.fixture
def relay_of() -> Iterator[Callable[..., Relay]]:
    """Start a relay of groups of these names, whose file has these keys."""
    with SimulatedWorld(1) as world:
        started: list[Relay] = []

        def start(names, **keys):
            loaded = _loaded(names, **keys)
            started.append(Relay(loaded, *world.join(loaded, {}), runtime=world.runtime))
            return started[-1].__enter__()

        yield start
        for relay in started:
            relay.close()


def _loaded(names, **keys) -> Config:
    group = {"policy": "exact_time", "topics": inputs({"/a": VECTOR, "/b": VECTOR})}
    return load_text(config(dict.fromkeys(names, group), metrics=None, **keys))


def _evaluated_at(relay):
    """When each group was evaluated last."""
    return {report.facts.name: report.facts.figures.now for report in relay.monitor.reports}


def _evaluated_next(relay):
    """Names of those that the relay evaluates next."""
    before = _evaluated_at(relay)
    while _evaluated_at(relay) == before:
        relay.step()
    return [name for name, seen in _evaluated_at(relay).items() if seen != before.get(name)]


@pytest.mark.parametrize(("n_groups", "at_a_time", "turns"), [(5, 5, 1), (12, 5, 3), (61, 16, 4)])
def test_all_of_a_few_and_some_of_many_are_evaluated_at_a_time_and_none_is_left_out(
    relay_of, n_groups, at_a_time, turns
):
    relay = relay_of([f"g{n}" for n in range(n_groups)])
    assert len(_evaluated_next(relay)) == n_groups
    evaluated = [_evaluated_next(relay) for _ in range(turns)]
    assert [len(names) for names in evaluated] == [at_a_time] * turns
    assert set().union(*evaluated) == set(_evaluated_at(relay))


def test_whoever_asks_for_the_state_sees_all_as_they_are(relay_of):
    relay = relay_of(_NAMES)
    _evaluated_next(relay)
    assert len(_evaluated_next(relay)) == 5
    relay.state()
    assert _evaluated_next(relay) == _NAMES


def test_whoever_plots_them_sees_all_as_they_are(relay_of):
    relay = relay_of(_NAMES, diagnostics={"scalars": True})
    assert [_evaluated_next(relay) for _ in range(3)] == [_NAMES] * 3


def test_groups_that_a_reload_brings_are_evaluated_at_once(relay_of):
    relay = relay_of(_NAMES)
    _evaluated_next(relay)
    relay.reload(_loaded([*_NAMES, "new"]))
    assert "new" in _evaluated_next(relay)
    assert list(_evaluated_at(relay)) == [*_NAMES, "new"]


def test_a_report_stands_until_the_next_one_is_there(relay_of, monkeypatch):
    relay = relay_of(["a", "b", "c"])
    _evaluated_next(relay)
    evaluate, there = relay.monitor._evaluate_group, []  # noqa: SLF001  no other moment is within an evaluation

    def noted(*of):
        there.append(len(_evaluated_at(relay)))
        return evaluate(*of)

    monkeypatch.setattr(relay.monitor, "_evaluate_group", noted)
    _evaluated_next(relay)
    assert there == [3] * 3


def test_a_group_that_cannot_be_evaluated_is_named_and_its_last_report_is_gone(relay_of, monkeypatch, caplog):
    relay = relay_of(["g0", "g1"])
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
