"""What decides the result of a recording: files are edited at random, and results compared where fingerprints agree."""

import json
import random
from collections import Counter
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from syncrelay.config import Config, ConfigError, load_text
from syncrelay.recordings.datasets.tables import Content
from syncrelay.recordings.fleet.export_tasks import LerobotTask, ParquetTask
from syncrelay.recordings.fleet.task import Source, Task
from syncrelay.recordings.fleet.tasks import AnalyzeTask, ReplayTask
from tests.faults.extent import chosen
from tests.recordings.bag.making import write_mcap
from tests.ros.streams import at, jittery, merged

DRAWN: Final = chosen(short=30, long=2_000)
VECTOR: Final = "geometry_msgs/msg/Vector3Stamped"
BASE: Final[dict[str, Any]] = {
    "version": 1,
    "node": {"name": "relay"},
    "groups": {
        "front": {
            "policy": "approximate_time",
            "slop": "20ms",
            "queue_size": 5,
            "topics": [{"topic": "/camera", "type": VECTOR}, {"topic": "/lidar", "type": VECTOR}],
        },
        "back": {
            "policy": "latest_time",
            "trigger": "/lidar",
            "max_age": "200ms",
            "topics": [{"topic": "/lidar", "type": VECTOR}, {"topic": "/imu", "type": VECTOR}],
        },
    },
    "export": {"lerobot": {"group": "front", "fps": 10, "task": "pick", "features": {"action": "/camera:vector"}}},
}
TABLES: Final = frozenset({"parquet", "lerobot"})
OF_FRONT: Final = TABLES
ALL: Final = frozenset({"parquet", "lerobot", "analyze", "mcap"})

# Keys of the file with values, whatever they do.
OF_GROUPS: Final[dict[str, tuple[Any, ...]]] = {
    "slop": ("1ms", "9ms", "30ms"),
    "queue_size": (1, 2, 50),
    "age_penalty": (0, 0.5),
    "max_wait": ("1ms", "50ms"),
    "max_rate": ("2 Hz", "5 Hz"),
    "every": (2, 3),
    "restamp": ("earliest", "latest", "/lidar"),
    "trigger": ("10 Hz", "/imu"),
    "max_age": ("5ms", "1s"),
    "policy": ("exact_time", "approximate_time_eager"),
}
OF_TOPICS: Final[dict[str, tuple[Any, ...]]] = {
    "offset": ("-12ms", "7ms"),
    "stamp": ("receive",),
    "min_period": ("90ms",),
    "max_age": ("5ms", "1s"),
    "required": (False,),
}
OF_LEROBOT: Final[dict[str, tuple[Any, ...]]] = {
    "fps": (5, 20),
    "task": ("place",),
    "max_gap": ("50ms", "9s"),
    "features": ({"action": "/lidar:vector"}, {"action": "/camera:vector.x"}),
}
# Keys that decide what the relay publishes, and no set.
OF_OUTPUTS: Final[dict[str, tuple[Any, ...]]] = {"manifest": (False,), "output_prefix": ("/z",)}
OF_OUTPUT: Final[dict[str, tuple[Any, ...]]] = {"output": ("/z",), "qos": ("sensor_data", {"depth": 3})}
# Sections and keys that decide nothing of a recording's results.
OF_RELAYS: Final[tuple[dict[str, Any], ...]] = (
    {"metrics": None},
    {"metrics": {"listen": "127.0.0.1:9470"}},
    {"diagnostics": {"scalars": True}},
    {"node": {"name": "relay", "transport": "large_messages"}},
    {"node": {"name": "relay", "use_sim_time": True, "services": False, "lifecycle": True}},
    {"x-notes": "of the drive"},
)


class Edited:
    """A file that was edited, and the tasks whose results that cannot change."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.file = deepcopy(BASE)
        self.neutral = ALL
        self.kinds: list[str] = []
        for _ in range(self.random.choice((1, 1, 2))):
            self.kinds.append(self.random.choice(("value", "input", "lerobot", "outputs", "output", "relay", "group")))
            getattr(self, f"_{self.kinds[-1]}")()
        self.text = self._written()

    def _key(self, keys: dict[str, Any], among: dict[str, tuple[Any, ...]]) -> None:
        key = self.random.choice([*among])
        keys[key] = self.random.choice(among[key])

    def _a_group(self) -> dict[str, Any]:
        name = self.random.choice([*self.file["groups"]])
        if name != "front":
            self.neutral &= OF_FRONT
        else:
            self.neutral &= frozenset()
        return self.file["groups"][name]

    def _value(self) -> None:
        self._key(self._a_group(), OF_GROUPS)

    def _input(self) -> None:
        self._key(self.random.choice(self._a_group()["topics"]), OF_TOPICS)

    def _lerobot(self) -> None:
        self.neutral -= {"lerobot"}
        self._key(self.file["export"]["lerobot"], OF_LEROBOT)

    def _outputs(self) -> None:
        self.neutral -= {"mcap"}
        self._key(self.random.choice([*self.file["groups"].values()]), OF_OUTPUTS)

    def _output(self) -> None:
        self.neutral -= {"mcap"}
        group = self.random.choice([*self.file["groups"].values()])
        self._key(self.random.choice(group["topics"]), OF_OUTPUT)

    def _relay(self) -> None:
        self.file |= self.random.choice(OF_RELAYS)
        if self.random.random() < 0.3:
            self.random.choice([*self.file["groups"].values()])["lazy"] = True

    def _group(self) -> None:
        """Another group is renamed, removed, or joined by one more."""
        self.neutral &= OF_FRONT
        groups, what = self.file["groups"], self.random.choice(("rename", "remove", "add"))
        if what == "add" or "back" not in groups:
            groups["more"] = deepcopy(groups["front"])
        else:
            back = groups.pop("back")
            if what == "rename":
                groups["rear"] = back

    def _written(self) -> str:
        """The same values in other words: order, units, style, comments, and where they come from."""
        file = deepcopy(self.file)
        front = file["groups"]["front"]
        if front.get("slop") == "20ms":
            front["slop"] = self.random.choice(("20ms", 0.02, "20000 us", "${SLOP:-20ms}"))
        if self.random.random() < 0.3 and "defaults" not in file and "queue_size" not in file["groups"].get("back", {}):
            for group in file["groups"].values():
                group.setdefault("queue_size", 10)
            file["defaults"] = {"queue_size": front.pop("queue_size")}
        if self.random.random() < 0.5:
            for name in ("front", "back"):
                keys = [*file["groups"].get(name, {}).items()]
                self.random.shuffle(keys)
                if keys:
                    file["groups"][name] = dict(keys)
        lines = json.dumps(file, indent=self.random.choice((1, 2, 4))).splitlines()
        for _ in range(self.random.randrange(4)):
            lines.insert(self.random.randrange(len(lines)), f"# {self.random.random()}")
        return "\n".join(lines)


def tasks_of(text: str) -> dict[str, Task]:
    config = load_text(text)
    front = [group for group in config.groups if group.name == "front"]
    return {
        "parquet": ParquetTask.of(only(config, front), Content()),
        "lerobot": LerobotTask.of(config),
        "analyze": AnalyzeTask.of(file="file.yaml", text=text, topics=()),
        "mcap": ReplayTask.of(config, (), 0, "zstd"),
    }


def only(config: Config, groups: list[Any]) -> Config:
    """As `export --group` takes them."""
    return replace(config, groups=tuple(groups))


def results(task: Task, source: Source, folder: Path) -> dict[str, Any]:
    folder.mkdir(parents=True)
    facts = task.run(source, folder)
    files = {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    return {"facts": json.dumps(facts, sort_keys=True), **files}


@pytest.fixture
def source(tmp_path):
    frames = merged(
        jittery("/camera", period_ms=50, jitter_ms=9, count=60, seed=1),
        jittery("/lidar", period_ms=100, jitter_ms=9, count=30, seed=2),
        at("/imu", *range(0, 3_000, 20)),
    )
    return Source("bag-0123456789abcdef", str(write_mcap(tmp_path / "bag.mcap", frames)))


@pytest.mark.faults
def test_results_of_one_fingerprint_are_the_same_and_what_changes_none_keeps_it(source, tmp_path):
    before = tasks_of(json.dumps(BASE))
    was = {name: results(task, source, tmp_path / "base" / name) for name, task in before.items()}
    seen: Counter[tuple[str, bool]] = Counter()
    for seed in range(DRAWN):
        edited = Edited(seed)
        where = f"seed {seed} of {DRAWN}, {edited.kinds}:\n{edited.text}"
        try:
            now = tasks_of(edited.text)
        except ConfigError:
            seen["refused", False] += 1
            continue
        for name, task in now.items():
            is_kept = task.fingerprint == before[name].fingerprint
            seen[name, is_kept] += 1
            assert is_kept or name not in edited.neutral, f"{name}: {where}"
            if is_kept:
                # What it says about its file's keys is of the base, too.
                assert results(task, source, tmp_path / str(seed) / name) == was[name], f"{name}: {where}"
    assert all(seen[name, is_kept] > DRAWN // 10 for name in ALL for is_kept in (True, False)), seen
