"""A policy that is an engine class and a model of its options, as docs/architecture.md has it, is known everywhere."""

from contextlib import closing
from pathlib import Path
from typing import Any, Literal, get_args

import pytest
from jsonschema import Draft7Validator
from pydantic import Field

from syncrelay.bag import open_recording
from syncrelay.bag.analysis import analyze
from syncrelay.bag.bindings import bind
from syncrelay.cli.analysis_html import as_html
from syncrelay.config import ConfigError, Tolerance, load_text, policies
from syncrelay.config.keys import Duration
from syncrelay.config.models import Group, Inputs, Topic, Topics
from syncrelay.config.schema import json_schema
from syncrelay.explain import Code
from syncrelay.sync import ApproximateEpsilonTime
from tests.bag.making import write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import MS, jittery, merged

_TOPICS = ("/left", "/right")


class WithinGap(ApproximateEpsilonTime):
    """The oldest messages are a set if their stamps lie less than a gap apart."""

    def __init__(self, *, n_inputs: int, queue_size: int, gap_ns: int) -> None:
        super().__init__(n_inputs=n_inputs, queue_size=queue_size, epsilon_ns=max(0, gap_ns - 1))


class WithinGapGroup(Group):
    """Sets of stamps less than a gap apart."""

    policy: Literal["within_gap"] = Field(description="Sets of stamps less than a gap apart.")
    gap: Duration = Field(description="The gap.", examples=["20ms"])
    topics: tuple[Topic, ...] = Topics

    @property
    def tolerance(self) -> Tolerance:
        return Tolerance("gap", self.gap)

    def build_policy(self, _inputs: Inputs) -> WithinGap:
        return WithinGap(n_inputs=len(self.topics), queue_size=self.queue_size, gap_ns=self.gap)


@pytest.fixture(autouse=True)
def _within_gap(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policies, "GROUP_MODELS", (*policies.GROUP_MODELS, WithinGapGroup))


def _text(gap: str, **keys: str) -> str:
    return config({"fused": _keys(gap=gap, **keys)})


def _keys(**keys: str) -> dict[str, Any]:
    return {"policy": "within_gap", "topics": inputs(dict.fromkeys(_TOPICS, VECTOR)), **keys}


def _recording(folder: Path) -> Path:
    streams = [jittery(topic, period_ms=100, jitter_ms=3, count=60, seed=seed) for seed, topic in enumerate(_TOPICS)]
    return write_mcap(folder / "drive.mcap", merged(*streams))


def test_its_options_are_read_and_checked_and_in_the_schema():
    (group,) = load_text(_text("50ms")).groups
    assert isinstance(group.options, WithinGapGroup)
    assert group.options.gap == 50 * MS
    with pytest.raises(ConfigError, match=r"fused\.gap: unknown unit `parsecs`"):
        load_text(_text("50 parsecs"))
    with pytest.raises(
        ConfigError, match=r"fused\.age_penalty: within_gap has no `age_penalty`, only approximate_time"
    ):
        load_text(_text("50ms", age_penalty="0.2"))
    assert Draft7Validator(json_schema()).is_valid({"version": 1, "groups": {"fused": _keys(gap="50ms")}})
    assert not Draft7Validator(json_schema()).is_valid({"version": 1, "groups": {"fused": _keys(slop="50ms")}})


def test_a_recording_is_analyzed_by_it_and_drawn(tmp_path: Path):
    bag, text = _recording(tmp_path), _text("1ms")
    with closing(open_recording([str(bag)])) as recording:
        analysis = analyze(recording, text, bind(load_text(text), recording))
    (group,) = analysis.groups
    assert group.suggestion.now < group.suggestion.possible
    assert [change.key for change in group.suggestion.changes] == ["gap"]
    (found,) = group.findings
    assert found.finding.code is Code.OVER_SLOP
    assert "gap 1 ms" in found.finding.text
    assert "`gap: " in (found.finding.suggestion or "")
    page = as_html(str(bag), analysis)
    assert "within_gap" in page
    assert "gap: " in page


@pytest.mark.parametrize("model", policies.GROUP_MODELS, ids=lambda model: model.__name__)
def test_what_the_options_say_of_a_policy_is_what_its_engine_does(model: type[Group]):
    values = {"slop": "20ms", "trigger": _TOPICS[0], "key": "header.frame_id"}
    needed = {key: value for key, value in values.items() if key in model.model_fields}
    (policy,) = get_args(model.model_fields["policy"].annotation)
    (group,) = load_text(config({"fused": {**_keys(**needed), "policy": policy}})).groups
    engine = group.options.build_policy(group.inputs)
    assert (group.options.by_stamp, group.options.repeats) == (engine.by_stamp, engine.repeats)
    assert set(group.options.matched_by) <= model.model_fields.keys()
