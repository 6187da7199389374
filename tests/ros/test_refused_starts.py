"""What ROS refuses as the relay starts, and what remaps make impossible: a sentence, an exit code, no traceback."""

import random
import sys
from collections.abc import Iterator

import pytest

from syncrelay.config import ConfigError, load_text
from syncrelay.errors import TypeImportError, UsageError
from tests.cli.command import GOOD, run
from tests.ros.processes import ros_environment

pytest.importorskip("rclpy", reason="rclpy is not installed")
ros_start = pytest.importorskip("syncrelay.ros.start")
own_relay = pytest.importorskip("tests.ros.in_process", reason="rclpy is not installed").own_relay

pytestmark = pytest.mark.ros

_LONG = "a" * 230
_FLAGS = ("-r", "--remap", "-p", "--param", "--params-file", "--log-level", "-e", "--bogus", "--ros-args", "--", "")
_WORDS = (
    "/x:=/y",
    "__ns:=/a",
    "__ns:=a//b",
    f"__ns:=/{_LONG}",
    "__node:=n",
    "__node:=/n",
    f"__node:={_LONG}{_LONG}",
    f"/x:=/{_LONG}{_LONG}",
    "=:",
    "*:=/a",
    "use_sim_time:=maybe",
    "use_sim_time:=[1",
    "use_sim_time:=true",
    "start_type_description_service:=5",
    "a.b:=3",
    "/nowhere",
    "/etc/passwd",
    "info",
    "é:=ü",
    "\x1b[31m:=x",
    "x:=\n",
    "",
)


@pytest.fixture(autouse=True)
def _alone(ros_domain: int, tmp_path, monkeypatch):
    for name, value in ros_environment(domain=ros_domain, folder=tmp_path).items():
        monkeypatch.setenv(name, value)


def _started(ros_args: list[str]) -> str:
    """Start a node with these arguments and end it; the name that it gives to `/x`."""
    context = ros_start.start(ros_args, simulated=False)
    try:
        node = ros_start.make_node("syncrelay", namespace="", context=context, ros_args=ros_args)
        try:
            return ros_start.resolver(node, ros_args)("/x")
        finally:
            node.destroy_node()
    finally:
        context.try_shutdown()


@pytest.mark.parametrize(
    ("ros_args", "said"),
    [
        (["-p", "use_sim_time:=maybe"], "'maybe' of type 'STRING', expecting type 'BOOL'"),
        (["-r", f"__ns:=/{_LONG}"], "topic length should not exceed"),
        (["-r", f"__node:={_LONG}{_LONG}"], "node name length should not exceed '255'"),
        (["-r", f"/x:=/{_LONG}{_LONG}"], "they give the topic `/x` a name that ROS rejects"),
        (["-r", "nonsense"], "Couldn't parse remap rule: '-r nonsense'"),
        (["--params-file", "/nowhere.yaml"], "Error opening YAML file"),
        (["-e", "enclave"], "Enclave name is not valid"),
        (["--bogus"], "--bogus"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_arguments_that_ros_does_not_take_are_usage(ros_args, said):
    with pytest.raises(UsageError) as raised:
        _started(ros_args)
    assert str(raised.value).startswith("ROS rejects --ros-args -")
    assert said in str(raised.value)
    assert "/project/" not in str(raised.value)


def _arguments(chance: random.Random) -> Iterator[str]:
    for _ in range(chance.randint(1, 3)):
        yield from (chance.choice(_FLAGS), chance.choice(_WORDS))


def test_of_any_arguments_there_comes_a_node_or_a_sentence():
    chance = random.Random(14)
    said = []
    for _ in range(300):
        try:
            _started(list(_arguments(chance)))
        except UsageError as error:
            said.append(str(error))
    assert 0 < len(said) < 300
    assert all(text.startswith("ROS rejects --ros-args ") for text in said)
    assert all("\x1b" not in text for text in said)


@pytest.mark.parametrize(
    ("words", "environ", "code", "said"),
    [
        (["--ros-args", "-p", "use_sim_time:=maybe"], {}, 2, "syncrelay: ROS rejects --ros-args -p"),
        ([], {"ROS_DOMAIN_ID": "300"}, 69, "syncrelay: ROS_DOMAIN_ID=300 is not a domain"),
        (
            ["--ros-args", "-r", "/front/a:=/a"],
            {},
            1,
            "the default output `/a`, remapped from `/front/a`, is also an input",
        ),
    ],
    ids=["parameter", "domain", "loop"],
)
def test_the_relay_ends_with_a_sentence(words, environ, code, said, tmp_path):
    (tmp_path / "f.yaml").write_text(GOOD)
    done = run("--config", "f.yaml", *words, folder=tmp_path, environ=environ)
    assert done.returncode == code
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_a_reload_that_remaps_turn_into_a_loop_is_refused_and_the_running_file_kept():
    running = load_text(GOOD)
    with own_relay(running, ros_args=["-r", "/c:=/front/a"]) as relay:
        before = names_of(relay.evaluate())
        with pytest.raises(ConfigError) as raised:
            relay.reload(load_text(GOOD.replace("topic: /b", "topic: /c")))
        after = names_of(relay.evaluate())
    assert "`/front/a` is also an input (line 7, remapped from `/c`)" in str(raised.value)
    assert after == before == [("/a", "/front/a"), ("/b", "/front/b")]


def names_of(reports):
    return [(each.name, each.output) for report in reports for each in report.facts.inputs]


def test_a_file_with_transforms_is_refused_where_the_type_of_tf_is_not_installed(monkeypatch):
    # Another test of this process may have imported it.
    for name in ("tf2_msgs", "tf2_msgs.msg"):
        monkeypatch.setitem(sys.modules, name, None)
    file = GOOD.replace("policy:", "transforms: {target: base_link}\n    policy:", 1)
    with pytest.raises(TypeImportError) as refused:
        own_relay(load_text(file))
    assert "tf2_msgs/msg/TFMessage cannot be imported" in str(refused.value)
    assert "`apt-get install ros-jazzy-tf2-msgs`" in str(refused.value)
