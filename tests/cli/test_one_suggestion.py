"""A key of a group has one suggested value in all that `analyze` shows, and the value gives the sets of one moment.

Recordings are drawn by seed: of each set it is known which messages were made together, so also the slop and the queue
that it needs.
"""

import html
import json
import random
import re
from dataclasses import dataclass, field

import pytest

from syncrelay.config import load_text
from syncrelay.config.units import parse_duration
from syncrelay.recordings.analysis.evaluation import evaluate
from syncrelay.recordings.analysis.streams import read_streams
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from tests.cli.command import run_here
from tests.faults.extent import chosen
from tests.recordings.bag.making import write_mcap
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.frames import Frame
from tests.ros.streams import BEGIN, MS, at
from tests.ros.summary import read_summary

_SETS = 150
_DRAWN = chosen(short=4, long=40)
_VALUE = re.compile(r"`(slop|queue_size|max_wait|policy|offset): ([^`]+)`(?: at (/\w+))?")


@dataclass
class Drawn:
    """A rig of topics of one rate, or one that is several times faster, and what its sets need."""

    seed: int
    frames: list[Frame] = field(default_factory=list)
    moments: dict[tuple[str, int], int] = field(default_factory=dict)
    """By topic and stamp: which moment a message was made at."""

    def __post_init__(self) -> None:
        chance = random.Random(f"one suggestion {self.seed}")
        self.topics = ["/camera", "/lidar", "/radar"][: chance.choice([2, 2, 3])]
        self.period = chance.choice([50, 100])
        self.faster = chance.choice([1, 1, 4])
        self.late = chance.choice([0, 0, 10]) * self.period
        self.lost = chance.choice([0, 0.1])
        jitter = 0.04 * self.period / self.faster
        spans = []
        kept = 0
        made: dict[str, list[float]] = {topic: [] for topic in self.topics}
        for moment in range(_SETS):
            together = []
            for number, topic in enumerate(self.topics):
                phase = number * 0.1 * self.period / self.faster
                for part in range(self.faster if number else 1):
                    offset = (moment + part / self.faster) * self.period + phase + chance.uniform(-jitter, jitter)
                    if part == 0 and number and chance.random() < self.lost:
                        continue
                    made[topic].append(offset)
                    if part == 0:
                        self.moments[topic, BEGIN + round(offset * MS)] = moment
                        together.append(offset)
            if len(together) == len(self.topics):
                kept += 1
                spans.append(max(together) - min(together))
        self.sets, self.needed_slop = kept, max(spans) * MS
        self.slop = chance.choice([0.5, 3]) * max(spans)
        self.queue_size = 10 if self.late else 5
        for topic in self.topics:
            delay = self.late if topic == self.topics[-1] else 5
            self.frames += [frame._replace(time=frame.time + delay * MS) for frame in at(topic, *made[topic])]
        self.frames.sort(key=lambda frame: frame.time)

    @property
    def text(self) -> str:
        topics = inputs(dict.fromkeys(self.topics, VECTOR))
        slop = f"{self.slop:.3f}ms"
        group = {"policy": "approximate_time", "slop": slop, "queue_size": self.queue_size, "topics": topics}
        return config({"front": group})


def _named(text: str) -> set[tuple[str, str, str]]:
    return {(key, topic, value) for key, value, topic in _VALUE.findall(text)}


@pytest.mark.faults
@pytest.mark.parametrize("seed", range(_DRAWN))
def test_every_view_of_a_recording_names_one_value_and_it_gives_the_sets_of_one_moment(seed, tmp_path):
    drawn = Drawn(seed)
    write_mcap(tmp_path / "bag.mcap", drawn.frames)
    (tmp_path / "f.yaml").write_text(drawn.text)
    words = ("analyze", "bag.mcap", "--config", "f.yaml")
    group = json.loads(run_here(*words, "--json", folder=tmp_path).stdout)["groups"][0]
    shown = run_here(*words, "--html", "page.html", "--write", "better.yaml", folder=tmp_path).stdout
    page = html.unescape((tmp_path / "page.html").read_text())

    changes = {(each["key"], each["topic"]): str(each["value"]) for each in group["suggestion"]["changes"]}
    values = {(key, "", value) for (key, topic), value in changes.items() if topic is None}
    for finding in group["findings"]:
        values |= _named(finding["suggestion"] or "")
    values |= _named(shown) | _named(page)
    keys = [(key, topic) for key, topic, _ in values]
    assert len(keys) == len(set(keys)), values

    then = group["suggestion"]["then"]
    for key, curve in (("slop", group["by_slop"]), ("queue_size", group["by_queue_size"])):
        value = changes.get((key, None))
        if value is not None:
            suggested = int(value) if key == "queue_size" else parse_duration(value)
            assert {point["sets"] for point in curve if point[key] == suggested} == {then}
            assert f"{key}: {value}" in shown
            assert f"{key}: {value}" in page
    if ("slop", None) in changes:
        assert drawn.needed_slop <= parse_duration(changes["slop", None]) <= 3 * drawn.needed_slop

    better = tmp_path / "better.yaml"
    text = better.read_text() if better.exists() else drawn.text
    (tmp_path / "better.yaml").write_text(text)
    assert then >= 0.98 * drawn.sets
    replayed = run_here("replay", "bag.mcap", "--config", "better.yaml", folder=tmp_path)
    assert read_summary(replayed.stdout)["front"].sets >= then
    assert _of_one_moment(drawn, tmp_path, text) >= 0.98 * drawn.sets


def _of_one_moment(drawn, folder, text):
    """How many sets a file gives whose messages were made together."""
    recording = open_recording([str(folder / "bag.mcap")])
    bindings = bind(load_text(text), recording)
    (streams,) = read_streams(recording, bindings)
    recording.close()
    moments = [
        {drawn.moments.get((topic, stamp)) for topic, stamp in zip(drawn.topics, each.stamps, strict=True)}
        for each in evaluate(bindings[0].group, streams).sets
    ]
    return sum(len(each) == 1 and None not in each for each in moments)
