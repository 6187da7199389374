"""A policy that is an engine class and a model of its options, as docs/architecture.md has it, is known everywhere."""

import random
import re
from contextlib import closing
from pathlib import Path
from typing import Annotated, Any, Final, Literal, get_args

import pytest
from jsonschema import Draft7Validator
from pydantic import Field, create_model

from syncrelay.config import ConfigError, Tolerance, load_text, policies
from syncrelay.config.keys import Duration, TopicName
from syncrelay.config.models import Group, Inputs, Topic, Topics
from syncrelay.config.schema import json_schema
from syncrelay.explain import Code
from syncrelay.recordings.analysis import GroupAnalysis, analyze
from syncrelay.recordings.analysis.html import as_html
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.sync import ApproximateEpsilonTime
from tests.faults.extent import chosen
from tests.recordings.bag.making import write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import MS, at, jittery, merged

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


class LedGroup(WithinGapGroup):
    """The same at each message of one input, which need not be newer than the others as a trigger of latest_time is."""

    policy: Literal["led"] = Field(description="At each message of the leader, the others less than a gap away.")  # type: ignore[assignment]
    leader: TopicName = Field(description="Input whose every message makes a set.", examples=["/camera/image_raw"])

    @property
    def trigger_topic(self) -> str:
        return self.leader


@pytest.fixture(autouse=True)
def _new_policies(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policies, "GROUP_MODELS", (*policies.GROUP_MODELS, WithinGapGroup, LedGroup))


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


def _apart(by_ms: float, *, seed: int) -> list[Frame]:
    """Two inputs of 10 Hz, of which the second is stamped so much later, 1 ms more or less."""
    chance = random.Random(seed)
    first = [100.0 * n for n in range(1, 61)]
    return merged(at("/left", *first), at("/right", *(each + by_ms + chance.uniform(-1, 1) for each in first)))


def _analyzed(frames: list[Frame], path: Path, **keys: str) -> GroupAnalysis:
    text = _text(**keys)
    with closing(open_recording([str(write_mcap(path, frames))])) as recording:
        (group,) = analyze(recording, text, bind(load_text(text), recording)).groups
    return group


def test_of_a_trigger_it_is_judged_what_its_own_model_measures(tmp_path: Path):
    seed, draws = 28, chosen(short=3, long=40)
    chance = random.Random(seed)
    for n in range(draws):
        by, is_too_wide = chance.choice([-1, 1]) * chance.uniform(5, 45), n % 3 < 2
        # The one that is stamped earlier, and the later one, in turns.
        leader = _TOPICS[(by < 0) ^ (n % 2)]
        gap = chance.uniform(1, abs(by) - 3) if is_too_wide else chance.uniform(abs(by) + 3, 60)
        drawn = f"draw {n} of {draws}, seed {seed}: /right {by:.1f} ms after /left, led by {leader}, gap {gap:.1f} ms"
        frames = _apart(by, seed=n)
        group = _analyzed(frames, tmp_path / f"{n}.mcap", policy="led", leader=leader, gap=f"{gap:.3f}ms")
        assert not group.group.held, drawn
        assert group.suggestion.possible == 60, drawn
        assert [each.finding.code for each in group.findings] == [Code.OVER_SLOP] * is_too_wide, drawn
        for finding in (each.finding for each in group.findings):
            span = re.match(r"the nearest sets span (\S+) ms to (\S+) ms, over gap ", finding.text)
            assert span is not None, f"{drawn}: {finding.text}"
            assert abs(by) - 1.1 <= float(span[1]) < float(span[2]) <= abs(by) + 1.1, f"{drawn}: {finding.text}"
            wider = re.match(r"write `gap: (\S+)ms`", finding.suggestion or "")
            assert wider is not None, f"{drawn}: {finding.suggestion}"
            assert abs(by) + 1 <= float(wider[1]) <= 1.25 * abs(by) + 2, f"{drawn}: {finding.suggestion}"


# Types of keys, each with a value as it is written and as it is read.
_TYPES: Final[tuple[tuple[Any, Any, Any], ...]] = (
    (Duration, "20ms", 20 * MS),
    (Annotated[int, Field(ge=1)], 5, 5),
    (Annotated[int, Field(ge=2)], 5, 5),
    (int, 5, 5),
    (str, "a", "a"),
    (bool, False, False),
)
# What has a key of this name already, by its type above: every group, or within_gap.
_THERE: Final = {"lazy": 5, "manifest": 5, "gap": 0}
_NAMES: Final = ("one", "other")


def test_policies_may_share_a_key_of_one_type_and_none_of_two(monkeypatch: pytest.MonkeyPatch):
    seed, draws, there = 2228, chosen(short=12, long=300), policies.GROUP_MODELS
    chance = random.Random(seed)
    for n in range(draws):
        key, first = chance.choice(["window", "window", *_THERE]), chance.randrange(len(_TYPES))
        first = chance.choice([first, _THERE.get(key, first)])
        second = chance.choice([first, chance.randrange(len(_TYPES))])
        drawn = f"draw {n} of {draws}, seed {seed}: `{key}` is {_TYPES[first][0]} and {_TYPES[second][0]}"
        keys: list[dict[str, Any]] = [
            {"policy": (Literal[name], Field(description=name)), key: (_TYPES[of][0], Field(description=name))}
            for name, of in zip(_NAMES, (first, second), strict=True)
        ]
        models = [create_model("AGroup", __base__=Group, **each) for each in keys]
        monkeypatch.setattr(policies, "GROUP_MODELS", (*there, *models))
        groups = {name: {"policy": name, "topics": inputs(dict.fromkeys(_TOPICS, VECTOR))} for name in _NAMES}
        text = config(groups, defaults={key: _TYPES[first][1]})
        is_shared = len({first, second, _THERE.get(key, first)}) == 1
        found: Any
        try:
            found = [getattr(each.options, key) for each in load_text(text).groups]
        except TypeError as error:
            found = str(error).partition(":")[0].partition(" than ")[0]
        refused = f"the key `{key}` of AGroup has another type"
        assert found == ([_TYPES[first][2]] * 2 if is_shared else refused), drawn


def test_no_two_policies_have_one_name(monkeypatch: pytest.MonkeyPatch):
    class SecondGroup(WithinGapGroup):
        pass

    monkeypatch.setattr(policies, "GROUP_MODELS", (*policies.GROUP_MODELS, SecondGroup))
    with pytest.raises(TypeError, match="WithinGapGroup and SecondGroup are both the policy within_gap"):
        load_text(_text("50ms"))


@pytest.mark.parametrize("model", policies.GROUP_MODELS, ids=lambda model: model.__name__)
def test_what_the_options_say_of_a_policy_is_what_its_engine_does(model: type[Group]):
    values = {"slop": "20ms", "trigger": _TOPICS[0], "key": "header.frame_id"}
    needed = {key: value for key, value in values.items() if key in model.model_fields}
    (policy,) = get_args(model.model_fields["policy"].annotation)
    (group,) = load_text(config({"fused": {**_keys(**needed), "policy": policy}})).groups
    engine = group.options.build_policy(group.inputs)
    assert (group.options.by_stamp, group.options.repeats) == (engine.by_stamp, engine.repeats)
    assert set(group.options.matched_by) <= model.model_fields.keys()
