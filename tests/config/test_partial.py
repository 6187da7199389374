"""A fault hides no other, nothing is said that only follows from one, and what is checked is what the relay uses."""

import random
from pathlib import Path

import pytest

from syncrelay.config import ConfigError, Problem, load_text

_FILES = sorted((Path(__file__).parent / "invalid").rglob("*.yaml"))
# Where these are found, there is no tree in which more could be.
_NO_TREE = ("yaml", "encoding", "empty")

_BASE = """\
version: 1
node: {name: relay}
defaults: {queue_size: 5}
groups:
  front:
    policy: approximate_time
    slop: 20ms
    restamp: none
    max_wait: 1s
    topics:
      - {topic: /a, type: sensor_msgs/msg/Image}
      - {topic: /b, type: sensor_msgs/msg/Image, required: false}
      - {topic: /c, type: sensor_msgs/msg/Image}
      - {topic: /d, type: sensor_msgs/msg/Image}
  rear:
    policy: latest_time
    trigger: /e
    topics:
      - {topic: /e, type: sensor_msgs/msg/Image}
      - {topic: /f, type: sensor_msgs/msg/Image, output: /g}
      - {topic: /h, type: sensor_msgs/msg/Image, qos: sensor_data}
  keyed:
    policy: equal_key
    output_prefix: /keyed
    topics:
      - {topic: /i, type: sensor_msgs/msg/Image, key: header.frame_id}
      - {topic: /j, type: sensor_msgs/msg/Image, key: header.frame_id}
"""
# Each is wrong by itself, whatever the others are.
_FAULTS = (
    ("version: 1", "version: 2"),
    ("name: relay", "name: re-lay"),
    ("queue_size: 5", "queue_size: 0"),
    ("slop: 20ms", "slop: 20 parsecs"),
    ("restamp: none", "restamp: /zzz"),
    ("topic: /a, type: sensor_msgs/msg/Image", "topic: /a, type: sensor_msgs/msg/Imagg"),
    ("topic: /c, type", "topic: /b, type"),
    ("{topic: /d, type: sensor_msgs/msg/Image}", "nothing"),
    ("trigger: /e", "trigger: /k"),
    ("output: /g", "output: /rear/e"),
    ("qos: sensor_data", "qos: sensor_dta"),
    ("output_prefix: /keyed", "output_prefix: key-ed"),
    ("topic: /j, type: sensor_msgs/msg/Image, key: header.frame_id", "topic: /j, type: sensor_msgs/msg/Image"),
)


def _problems(text: str, environ: dict[str, str]) -> list[Problem]:
    try:
        return list(load_text(text, environ=environ).notes)
    except ConfigError as error:
        return list(error.problems)


def _sentences(problems: list[Problem]) -> set[tuple[str, int, str]]:
    return {(each.code, each.span.line if each.span else 0, each.text) for each in problems}


def test_faults_together_are_told_as_each_alone(environ):
    assert _sentences(_problems(_BASE, environ)) == set()
    alone = [_sentences(_problems(_BASE.replace(*fault), environ)) for fault in _FAULTS]
    assert all(alone)
    for seed in range(60):
        chosen = random.Random(seed).sample(range(len(_FAULTS)), k=seed % len(_FAULTS) + 1)
        text = _BASE
        for index in chosen:
            text = text.replace(*_FAULTS[index])
        assert _sentences(_problems(text, environ)) == set().union(*(alone[index] for index in chosen)), text


@pytest.mark.parametrize("file", _FILES, ids=lambda file: file.stem)
def test_one_more_fault_at_the_end_of_a_file_hides_none_above(file: Path, environ):
    text = file.read_text(encoding="utf-8")
    before = _problems(text, environ)
    if any(problem.code in _NO_TREE for problem in before) or all(problem.path == "" for problem in before):
        return
    more = f"{text.rstrip()}\none_more_fault: 1\n"
    assert _sentences(before) <= _sentences(_problems(more, environ))
