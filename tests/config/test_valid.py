import json
from pathlib import Path

import pytest

from syncrelay.config import Listen, QosOverrides, Severity, load, load_text
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
