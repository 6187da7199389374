import json
from pathlib import Path

import pytest

from syncrelay.config import (
    DiagnosticsConfig,
    ExportFeature,
    ExportSource,
    LerobotConfig,
    Listen,
    QosOverrides,
    QosPreset,
    Severity,
    load,
    load_text,
)
from syncrelay.config.models import StampField
from syncrelay.sync import Restamp, Ticks

FOLDER = Path(__file__).parent / "valid"
EXAMPLES = Path(__file__).parents[2] / "configs"


@pytest.mark.parametrize("file", sorted(FOLDER.glob("*.yaml")), ids=lambda file: file.stem)
def test_a_file_in_order_loads_without_a_note(file, environ):
    assert load(str(file), environ=environ).notes == ()


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_example_is_in_order(file):
    config = load(str(file), environ={})
    assert {note.code for note in config.notes} <= {"not_checked"}


def test_every_key_arrives_where_it_is_used(environ):
    config = load(str(FOLDER / "all_keys.yaml"), environ=environ)
    assert (config.node.name, config.node.namespace, config.node.use_sim_time) == ("fusion", "/robot1", True)
    hosts = ("robot.lab.example", "10.0.0.5", "fd00::1", "10.0.0.6")
    assert config.listen == Listen("127.0.0.1", range(9500, 9501), hosts=hosts)
    assert config.diagnostics == DiagnosticsConfig(scalars=True)
    front, back = config.groups
    assert (front.name, back.name) == ("front", "back")
    assert front.restamp == 1
    assert back.restamp is Restamp.LATEST
    image, points, dock, chatter = front.topics
    assert (image.topic, image.type) == ("/camera/image_raw", "sensor_msgs/msg/Image")
    assert (image.offset_ns, image.min_period_ns) == (-12_000_000, 0)
    assert image.qos == QosPreset("sensor_data")
    assert image.stamp == "header"
    assert (points.offset_ns, points.min_period_ns) == (0, 90_000_000)
    assert points.qos == QosOverrides(
        history="keep_last",
        depth=7,
        reliability="best_effort",
        durability="volatile",
        deadline="1.5s",  # type: ignore[arg-type]  # as a file has it
        lifespan="2s",  # type: ignore[arg-type]  # and this
        liveliness="automatic",
        liveliness_lease_duration="500ms",  # type: ignore[arg-type]  # and this
        avoid_ros_namespace_conventions=False,
    )
    assert isinstance(dock.stamp, StampField)
    assert dock.stamp.field == "trigger.time"
    assert chatter.stamp == "receive"
    assert back.topics[0].qos == QosOverrides() == back.topics[1].qos
    covariance = ExportSource("/back/imu", "orientation_covariance")
    assert config.lerobot == LerobotConfig(
        group="back",
        fps=10,
        task=ExportSource("/back/task", "name"),
        max_gap_ns=300_000_000,
        keeps_incomplete=True,
        features=(
            ExportFeature("observation.images.back", (ExportSource("/back/image", None),)),
            ExportFeature("observation.state", (covariance, ExportSource("/back/image", "height"))),
            ExportFeature("action", (covariance,)),
        ),
    )


def test_a_trigger_is_a_clock_where_it_is_a_rate(environ):
    dataset, controller, film, labelled = load(str(FOLDER / "clock_trigger.yaml"), environ=environ).groups
    assert [each.ticks for each in (dataset, controller, film)] == [Ticks(30), Ticks(500), Ticks(2997, 100)]
    assert [each.trigger for each in (dataset, controller, film)] == [None] * 3
    assert (labelled.ticks, labelled.trigger, labelled.restamp) == (None, 1, 1)
    assert dataset.restamp is Restamp.TICK
    assert [each.held for each in (dataset, labelled)] == [(0, 1), (0,)]
    assert all(each.has_deadlines for each in (dataset, controller))
    assert not labelled.has_deadlines


def test_a_file_that_says_nothing_of_it_listens_on_this_machine_alone(environ):
    config = load(str(EXAMPLES / "camera_lidar.yaml"), environ=environ)
    assert config.listen == Listen("127.0.0.1", range(9464, 9474), is_asked_for=False)


def test_an_optional_input_that_nothing_waits_for_needs_no_max_wait(environ):
    group = load(str(FOLDER / "optional_state.yaml"), environ=environ).groups[0]
    assert [topic.required for topic in group.topics] == [True, False]
    assert group.options.max_wait is None
    assert group.engine().next_deadline() is None


def test_a_duration_of_the_middleware_has_a_largest_value(environ):
    text = (FOLDER / "shared_topic.yaml").read_text()
    no_limit = "qos: {lifespan: {sec: 9223372036, nsec: 854775807}, deadline: {sec: 9223372036854, nsec: 0}}"
    config = load_text(text.replace("qos: {}", no_limit), environ=environ)
    qos = config.groups[1].topics[1].qos
    assert isinstance(qos, QosOverrides)
    assert (qos.lifespan, qos.deadline) == (2**63 - 1, 2**63 - 1)


@pytest.mark.parametrize(
    ("slop", "note"),
    [
        ("40", "40 without a unit means 40 s: write 40ms if you mean milliseconds, otherwise 40s"),
        ("1.5", "1.5 without a unit means 1.5 s: write 1.5ms if you mean milliseconds, otherwise 1.5s"),
        ("0.04", None),
        ("40s", None),
    ],
)
def test_a_slop_of_seconds_without_a_unit_is_doubted(slop, note, environ):
    topics = [{"topic": name, "type": "sensor_msgs/msg/Image"} for name in ("/a", "/b")]
    text = f"version: 1\ngroups: {{g: {{policy: approximate_time, slop: {slop}, topics: {json.dumps(topics)}}}}}"
    found = load_text(text, environ=environ).notes
    assert [(each.text, each.severity) for each in found] == ([(note, Severity.WARNING)] if note else [])
