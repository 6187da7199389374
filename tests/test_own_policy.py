"""A policy of another package works in all commands; a broken package affects only files that use it."""

import json
import random
import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, get_args

import pytest
from jsonschema import Draft7Validator

from syncrelay.config import ConfigError, load_text
from syncrelay.config.installed import installed_policies
from syncrelay.config.models import Group
from syncrelay.config.policies import GROUP_MODELS
from syncrelay.dataflow.group import GroupRelay
from syncrelay.explain import Code
from syncrelay.recordings.analysis import GroupAnalysis, analyze
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from tests.cli.command import run, run_here, run_python
from tests.conformance.script import do, short
from tests.dataflow.payloads import FLOWS
from tests.faults.extent import chosen
from tests.own_policies import installed_example, offer, on_path
from tests.recordings.bag.making import write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import LOSSLESS, config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import MS, at, merged

_TOPICS = ("/left", "/right")
_TYPES = dict.fromkeys(_TOPICS, VECTOR)


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of examples/led-by, installed in a folder."""
    return installed_example(tmp_path_factory.mktemp("own_policy"))


def _keys(**keys: Any) -> dict[str, Any]:
    return {"policy": "led_by", "lead": "/left", "reach": "20ms", "topics": inputs(_TYPES, qos=LOSSLESS), **keys}


def _beside(package: Path) -> dict[str, str]:
    """An environment in which syncrelay and the package are installed."""
    return {"PYTHONPATH": f"{Path(__file__).parents[1]}:{package}"}


def test_what_the_page_shows_of_it_is_what_it_is():
    root = Path(__file__).parents[1]
    page = (root / "docs/howto/own_policy.md").read_text()
    shown = re.findall(r"^```(?:toml|python)\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    files = [each.read_text() for each in (root / "examples/led-by").rglob("*.[tp][oy]*")]
    assert [text for text in shown if not any(text in file for file in files)] == []
    assert len(shown) == 2


def test_its_keys_are_validated_with_suggestions(package: Path, tmp_path: Path):
    groups = {
        "good": _keys(),
        "misspelt": {**_keys(), "reech": "20ms"},
        "lost": _keys(lead="/lefty", output_prefix="/lost"),
        "slow": _keys(reach=20, output_prefix="/slow"),
        "other": _keys(policy="led_bye", output_prefix="/other"),
    }
    (tmp_path / "fusion.yaml").write_text(config(groups))
    done = run("validate", "fusion.yaml", folder=tmp_path, environ=_beside(package))
    heads = [line.split(" ", 1)[1] for line in done.stderr.splitlines() if line.startswith("fusion.yaml:")]
    assert [head for head in heads if "installed here" not in head] == [
        "groups.misspelt.reech: unknown key, did you mean `reach`?",
        "groups.lost.lead: `/lefty` is not an input of this group, did you mean `/left`?",
        "warning: groups.slow.reach: 20 without a unit means 20 s: write 20ms if you mean milliseconds, otherwise 20s",
        "groups.other.policy: unknown value `led_bye`, did you mean `led_by`?",
    ]
    (tmp_path / "fusion.yaml").write_text(config({"good": _keys()}))
    assert run("validate", "fusion.yaml", folder=tmp_path, environ=_beside(package)).returncode == 0
    without = run("validate", "fusion.yaml", folder=tmp_path)
    assert without.returncode == 1
    assert re.search(
        "groups.good.policy: expected exact_time, .*, found the string `led_by` .a policy of", without.stderr
    )


def test_editors_and_shells_complete_it(package: Path, tmp_path: Path):
    schema = json.loads(run("schema", folder=tmp_path, environ=_beside(package)).stdout)
    validator = Draft7Validator(schema)
    assert schema["definitions"]["LedByGroup"]["properties"]["lead"]["examples"] == ["/camera/image_raw"]
    assert validator.is_valid({"version": 1, "groups": {"fused": _keys()}})
    assert not validator.is_valid({"version": 1, "groups": {"fused": _keys(slop="50ms")}})
    (tmp_path / "fusion.yaml").write_text(config({"fused": _keys()}))
    words = {"COMP_LINE": "syncrelay --config fusion.yaml --group ", "_ARGCOMPLETE": "1"}
    words |= {"COMP_POINT": str(len(words["COMP_LINE"])), "_ARGCOMPLETE_STDOUT_FILENAME": "answer"}
    done = run_python(
        "-c",
        "from syncrelay.cli.completion import complete; complete()",
        folder=tmp_path,
        environ={**_beside(package), **words},
    )
    assert (tmp_path / "answer").read_text().split() == ["fused"], done.stderr


def _apart(by_ms: float, *, seed: int) -> list[Frame]:
    """Two inputs at 10 Hz; the second is stamped `by_ms` later, give or take 1 ms."""
    chance = random.Random(seed)
    first = [100.0 * n for n in range(1, 61)]
    return merged(at("/left", *first), at("/right", *(each + by_ms + chance.uniform(-1, 1) for each in first)))


def _analyzed(frames: list[Frame], path: Path, **keys: str) -> GroupAnalysis:
    text = config({"fused": _keys(**keys)})
    with closing(open_recording([str(write_mcap(path, frames))])) as recording:
        (group,) = analyze(recording, text, bind(load_text(text), recording)).groups
    return group


def test_a_recording_is_judged_by_it_and_its_own_key_is_suggested(package: Path, tmp_path: Path):
    seed, draws = 28, chosen(short=3, long=40)
    chance = random.Random(seed)
    with on_path(package):
        for n in range(draws):
            by, is_too_wide = chance.choice([-1, 1]) * chance.uniform(5, 45), n % 3 < 2
            # The input that is stamped earlier and the one that is stamped later lead in turns.
            lead = _TOPICS[(by < 0) ^ (n % 2)]
            reach = chance.uniform(1, abs(by) - 3) if is_too_wide else chance.uniform(abs(by) + 3, 60)
            drawn = (
                f"draw {n} of {draws}, seed {seed}: /right {by:.1f} ms after /left, led by {lead}, reach {reach:.1f} ms"
            )
            group = _analyzed(_apart(by, seed=n), tmp_path / f"{n}.mcap", lead=lead, reach=f"{reach:.3f}ms")
            assert group.suggestion.possible == 60, drawn
            assert [each.finding.code for each in group.findings] == [Code.OVER_SLOP] * is_too_wide, drawn
            for finding in (each.finding for each in group.findings):
                span = re.match(r"the nearest sets span (\S+) ms to (\S+) ms, over reach ", finding.text)
                assert span is not None, f"{drawn}: {finding.text}"
                assert abs(by) - 1.1 <= float(span[1]) < float(span[2]) <= abs(by) + 1.1, f"{drawn}: {finding.text}"
                wider = re.match(r"write `reach: (\S+)ms`", finding.suggestion or "")
                assert wider is not None, f"{drawn}: {finding.suggestion}"
                assert abs(by) + 1 <= float(wider[1]) <= 1.25 * abs(by) + 2, f"{drawn}: {finding.suggestion}"


def test_a_relay_matches_by_it_says_what_is_wrong_and_takes_another_value(package: Path, tmp_path: Path):
    far = [(do.write("/left", n), do.write("/right", n + 7), do.sleep(0.1)) for n in range(0, 6000, 100)]
    steps = (
        *(do.publisher(topic) for topic in _TOPICS),
        *(do.relay({"fused": _keys(reach="1ms")}), do.ready(), *(step for steps in far for step in steps)),
        *(do.finding("over_slop", "fused"), do.file({"fused": _keys(reach="10ms")}), do.hang_up(reloads=1)),
        *(do.subscriber(f"/fused{topic}") for topic in _TOPICS),
        *(do.ready(), do.feed("/left", 10_000), do.feed("/right", 10_007), do.feed("/left", 10_100)),
        *(do.out(f"/fused{topic}", 1) for topic in _TOPICS),
    )
    player, simulated = (
        pytest.importorskip(f"tests.conformance.{name}", reason="rclpy is not installed")
        for name in ("player", "simulated")
    )
    with on_path(package), simulated.SimulatedWorld(1) as world:
        seen = player.play(short("a policy of another package", *steps), world, tmp_path)
    assert "over reach #" in seen.notes[0][1]
    assert seen.outputs == {"/fused/left": ["10000.000 /left"], "/fused/right": ["10007.000 /right"]}


_MODEL = """
from typing import Literal
from pydantic import Field
from syncrelay.config.keys import Duration
from syncrelay.config.models import Group, Topic, Topics
from syncrelay.sync import ExactTime

class Mine(Group):
    policy: Literal["mine"] = Field(description="As exact_time.")
    topics: tuple[Topic, ...] = Topics
    def build_policy(self, inputs):
        return ExactTime(n_inputs=len(self.topics), queue_size=self.queue_size)
"""


@pytest.mark.parametrize(
    ("text", "of", "why"),
    [
        ("import no_such_module", "Mine", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("1 / 0", "Mine", "ZeroDivisionError: division by zero"),
        ("raise SystemExit(3)", "Mine", "SystemExit: 3"),
        ("", "Mine", "AttributeError: module 'robot_policies' has no attribute 'Mine'"),
        ("Mine = 3", "Mine", "robot_policies:Mine is no subclass of syncrelay.config.models.Group"),
        (_MODEL.replace('["mine"]', '["other"]'), "Mine", "`policy` of robot_policies:Mine has to be Literal['mine']"),
        (_MODEL.replace("tuple[Topic, ...]", "list[int]"), "Mine", "`topics` of robot_policies:Mine has to be a tuple"),
        (_MODEL + '    trigger_key = "lead"', "Mine", "the trigger_key of robot_policies:Mine is `lead`, which"),
        (_MODEL.replace("build_policy", "build"), "Mine", "robot_policies:Mine has no build_policy of its own"),
        (_MODEL + "    slop: int = 3", "Mine", "the key `slop` of Mine has another type than that of Approximate"),
        (_MODEL + '    gap: "Gap"', "Mine", "PydanticUserError: `Mine` is not fully defined"),
    ],
)
def test_a_broken_package_is_an_error_of_the_files_that_use_it_alone(text: str, of: str, why: str, tmp_path: Path):
    offer(tmp_path, "robot-policies", {"mine": of}, text=text)
    with on_path(tmp_path):
        assert load_text(_exact()).groups
        with pytest.raises(ConfigError) as raised:
            load_text(config({"fused": {"policy": "mine", "gap": "3ms", "topics": inputs(_TYPES)}}))
        (problem,) = raised.value.problems
        assert problem.text.splitlines()[0] in run_here("schema", folder=tmp_path).stderr
    assert problem.path == "groups.fused.policy"
    assert problem.text.startswith(f"the policy `mine` of robot-policies 1.0 cannot be used: {why}")


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("entry_points.txt", b"[syncrelay.policies]\nmine\n"),
        ("entry_points.txt", b"[syncrelay.policies]\nmine = \xff:Mine\n"),
        ("METADATA", b"Name: robot-policies\xff\n"),
    ],
)
def test_a_damaged_package_offers_nothing_and_harms_no_file(file: str, content: bytes, tmp_path: Path):
    offer(tmp_path, "robot-policies", {"mine": "Mine"}, text=_MODEL)
    (tmp_path / "robot_policies-1.0.dist-info" / file).write_bytes(content)
    with on_path(tmp_path):
        assert load_text(_exact()).groups
        assert "mine" not in installed_policies().models


def test_the_package_of_a_policy_that_fails_is_suspected_too(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    offer(tmp_path, "robot-policies", {"mine": "Mine"}, text=_MODEL)
    with on_path(tmp_path):
        (group,) = load_text(config({"fused": {"policy": "mine", "topics": inputs(_TYPES)}})).groups
        GroupRelay(group, now=lambda: 0, flow=FLOWS[0]).fail(KeyError("x"))
    assert "fused: a bug in syncrelay or in the package of the policy `mine` stopped this group;" in caplog.text


def _exact() -> str:
    return config({"fused": {"policy": "exact_time", "topics": inputs(_TYPES)}})


def test_what_two_packages_offer_is_used_from_neither(tmp_path: Path):
    for name in ("one-of-two", "other-of-two"):
        offer(tmp_path, name, {"mine": "Mine"}, text=_MODEL)
    with on_path(tmp_path):
        assert load_text(_exact()).groups
        with pytest.raises(ConfigError, match=r"`mine` is offered by one-of-two 1\.0 and other-of-two 1\.0: uninstall"):
            load_text(config({"fused": {"policy": "mine", "topics": inputs(_TYPES)}}))


def test_a_built_in_policy_is_not_replaced_and_a_warning_names_who_tries(tmp_path: Path):
    offer(tmp_path, "robot-policies", {"exact_time": "Mine"}, text=_MODEL.replace("mine", "exact_time"))
    with on_path(tmp_path):
        read = load_text(_exact())
    assert type(read.groups[0].options) is GROUP_MODELS[0]
    (warning,) = [note for note in read.notes if note.code == "policy"]
    assert warning.text.startswith("robot-policies 1.0 offers a policy of this name too, which is not used")


def test_two_policies_with_one_class_name_are_both_in_the_schema(tmp_path: Path):
    for name in ("mine", "yours"):
        text = _MODEL.replace('"mine"', f'"{name}"') + f"    {name}_gap: Duration = 0\n"
        offer(tmp_path, f"{name}-of-two", {name: "Mine"}, text=text)
    (tmp_path / "work").mkdir()
    done = run("schema", folder=tmp_path / "work", environ=_beside(tmp_path))
    validator = Draft7Validator(json.loads(done.stdout))
    for name in ("mine", "yours"):
        for key in ("mine_gap", "yours_gap"):
            group = {"policy": name, key: "3ms", "topics": inputs(_TYPES)}
            assert validator.is_valid({"version": 1, "groups": {"fused": group}}) == key.startswith(name)


# Types of keys, each with a value as it is written in a file and as it is read.
_KINDS = (
    ("Duration", "20ms", 20 * MS),
    ("Annotated[int, Field(ge=1)]", 5, 5),
    ("Annotated[int, Field(ge=2)]", 5, 5),
    ("int", 5, 5),
    ("str", "a", "a"),
    ("bool", False, False),
)
# Keys that every group has, with the index of their type above.
_THERE = {"lazy": 5, "manifest": 5}


@pytest.fixture
def folders(tmp_path: Path) -> Iterator[Path]:
    return (tmp_path / str(n) for n in range(10_000))


def test_policies_may_share_a_key_of_one_type_and_none_of_two(folders: Iterator[Path]):
    seed, draws = 2228, chosen(short=6, long=300)
    chance = random.Random(seed)
    for n, folder in zip(range(draws), folders, strict=False):
        key, first = chance.choice(["window", "window", *_THERE]), chance.randrange(len(_KINDS))
        first = chance.choice([first, _THERE.get(key, first)])
        second = chance.choice([first, chance.randrange(len(_KINDS))])
        drawn = f"draw {n} of {draws}, seed {seed}: `{key}` is {_KINDS[first][0]} and {_KINDS[second][0]}"
        folder.mkdir()
        for name, kind in (("one", first), ("other", second)):
            text = _MODEL.replace('"mine"', f'"{name}"').replace("Literal\n", "Annotated, Literal\n")
            offer(folder, name, {name: "Mine"}, text=f"{text}    {key}: {_KINDS[kind][0]} = Field(description='It.')\n")
        with on_path(folder):
            known = [name for name in ("one", "other") if name in installed_policies().models]
            is_first, is_second = (_THERE.get(key, kind) == kind for kind in (first, second))
            expected = ["one"] * is_first + ["other"] * (is_second and (first == second or not is_first))
            assert known == expected, drawn
            groups = {name: {"policy": name, "topics": inputs(_TYPES), "output_prefix": f"/{name}"} for name in known}
            if known:
                kind = first if "one" in known else second
                read = load_text(config(groups, defaults={key: _KINDS[kind][1]}))
                assert [getattr(each.options, key) for each in read.groups] == [_KINDS[kind][2]] * len(known), drawn


@pytest.mark.parametrize("model", GROUP_MODELS, ids=lambda model: model.__name__)
def test_what_the_options_say_of_a_policy_is_what_its_engine_does(model: type[Group]):
    examples = {
        key: str(field.examples[0])
        for key, field in model.model_fields.items()
        if field.is_required() and field.examples and key != "policy"
    }
    needed = {key: _TOPICS[0] if example.startswith("/") else example for key, example in examples.items()}
    if "key" in model.model_fields:
        needed["key"] = "header.frame_id"
    (policy,) = get_args(model.model_fields["policy"].annotation)
    (group,) = load_text(config({"fused": {"policy": policy, "topics": inputs(_TYPES), **needed}})).groups
    engine = group.options.build_policy(group.inputs)
    assert (group.options.by_stamp, group.options.repeats) == (engine.by_stamp, engine.repeats)
    assert set(group.options.matched_by) <= model.model_fields.keys()
