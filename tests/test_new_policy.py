"""A policy that is an engine class and a model of its options, as docs/policies.md has it, is known everywhere."""

from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, Literal, get_args

import pytest
from jsonschema import Draft7Validator
from pydantic import Field

from syncrelay.bag import open_recording
from syncrelay.bag.analysis import analyze
from syncrelay.bag.wiring import wire
from syncrelay.cli.analysis_html import as_html
from syncrelay.config import ConfigError, Tolerance, load_text, policies
from syncrelay.config.keys import Duration
from syncrelay.config.models import Group, Inputs, Topic, Topics
from syncrelay.config.schema import json_schema
from syncrelay.explain import Code
from syncrelay.sync import ExactTime, Message, Outcome
from syncrelay.sync.optional import OptionalInputs
from tests.bag.making import write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import MS, jittery, merged

_TOPICS = ("/left", "/right")


class SameSlot(ExactTime):
    """Messages whose stamps fall into one slot of time are a set."""

    def __init__(self, *, n_inputs: int, queue_size: int, slot_ns: int) -> None:
        super().__init__(n_inputs=n_inputs, queue_size=queue_size)
        self._slot_ns = slot_ns

    def for_required(self, required: Sequence[bool]) -> tuple["SameSlot", OptionalInputs]:
        _, stage = super().for_required(required)
        return SameSlot(n_inputs=sum(required), queue_size=self._queue_size, slot_ns=self._slot_ns), stage

    def feed(self, place: int, stamp: int, message: Message) -> Sequence[Outcome]:
        return super().feed(place, stamp // self._slot_ns, message)


class SameSlotGroup(Group):
    """Sets of stamps in one slot of time."""

    policy: Literal["same_slot"] = Field(description="Sets of stamps in one slot of time.")
    slot: Duration = Field(description="Length of a slot.", examples=["20ms"])
    topics: tuple[Topic, ...] = Topics

    @property
    def tolerance(self) -> Tolerance:
        return Tolerance("slot", self.slot)

    def build_policy(self, _inputs: Inputs) -> SameSlot:
        return SameSlot(n_inputs=len(self.topics), queue_size=self.queue_size, slot_ns=self.slot)


@pytest.fixture(autouse=True)
def _same_slot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policies, "GROUP_MODELS", (*policies.GROUP_MODELS, SameSlotGroup))


def _text(slot: str, **keys: str) -> str:
    return config({"fused": _keys(slot=slot, **keys)})


def _keys(**keys: str) -> dict[str, Any]:
    return {"policy": "same_slot", "topics": inputs(dict.fromkeys(_TOPICS, VECTOR)), **keys}


def _recording(folder: Path) -> Path:
    streams = [jittery(topic, period_ms=100, jitter_ms=3, count=60, seed=seed) for seed, topic in enumerate(_TOPICS)]
    return write_mcap(folder / "drive.mcap", merged(*streams))


def test_its_options_are_read_and_checked_and_in_the_schema():
    (group,) = load_text(_text("50ms")).groups
    assert isinstance(group.options, SameSlotGroup)
    assert group.options.slot == 50 * MS
    with pytest.raises(ConfigError, match=r"fused\.slot: unknown unit `parsecs`"):
        load_text(_text("50 parsecs"))
    with pytest.raises(ConfigError, match=r"fused\.age_penalty: same_slot has no `age_penalty`, only approximate_time"):
        load_text(_text("50ms", age_penalty="0.2"))
    assert Draft7Validator(json_schema()).is_valid({"version": 1, "groups": {"fused": _keys(slot="50ms")}})
    assert not Draft7Validator(json_schema()).is_valid({"version": 1, "groups": {"fused": _keys(slop="50ms")}})


def test_a_recording_is_analyzed_by_it_and_drawn(tmp_path: Path):
    bag, text = _recording(tmp_path), _text("1ms")
    with closing(open_recording([str(bag)])) as recording:
        analysis = analyze(recording, text, wire(load_text(text), recording))
    (group,) = analysis.groups
    assert group.suggestion.now < group.suggestion.possible
    assert [change.key for change in group.suggestion.changes] == ["slot"]
    (found,) = group.findings
    assert found.finding.code is Code.OVER_SLOP
    assert "slot 1 ms" in found.finding.text
    assert "`slot: " in found.finding.suggestion
    page = as_html(str(bag), analysis)
    assert "same_slot" in page
    assert "slot: " in page


@pytest.mark.parametrize("model", policies.GROUP_MODELS, ids=lambda model: model.__name__)
def test_what_the_options_say_of_a_policy_is_what_its_engine_does(model: type[Group]):
    values = {"slop": "20ms", "trigger": _TOPICS[0], "key": "header.frame_id"}
    needed = {key: value for key, value in values.items() if key in model.model_fields}
    (policy,) = get_args(model.model_fields["policy"].annotation)
    (group,) = load_text(config({"fused": {**_keys(**needed), "policy": policy}})).groups
    engine = group.options.build_policy(group.inputs)
    assert (group.options.by_stamp, group.options.repeats) == (engine.by_stamp, engine.repeats)
    assert set(group.options.matched_by) <= model.model_fields.keys()
