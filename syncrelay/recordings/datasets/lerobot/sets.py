"""The sets of a table that can be frames: those with all vectors, all pictures and the task."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa

from syncrelay.config import LerobotConfig
from syncrelay.errors import BagError
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.datasets.images import FrameError
from syncrelay.recordings.datasets.lerobot.pictures import FIELDS, PictureSource
from syncrelay.recordings.datasets.lerobot.vectors import NAME, VectorSource, field_of, has_joint_names, joined_names
from syncrelay.recordings.datasets.tables import Content

INCOMPLETE: Final = "with a message missing"
NOT_FINITE: Final = "with a value that is no finite number"
NO_IMAGE: Final = "with an image that cannot be decoded"


class FrameSet(NamedTuple):
    """What the frames of a set show, in the order of the features of each kind."""

    stamp: int
    vectors: tuple[np.ndarray[Any, Any], ...]
    pictures: tuple[np.ndarray[Any, Any], ...]
    task: str


class FrameSets:
    """The sets of one group of a recording, read as frames need them."""

    def __init__(self, config: LerobotConfig, binding: GroupBinding) -> None:
        """Raise BagError for an input that is to become a video and holds no images."""
        types = {each.topic: each.config.type or "" for each in binding.inputs}
        self.unusable: Counter[str] = Counter()
        """How many sets cannot be a frame, by reason."""
        self.complete = 0
        """How many sets have all messages that a frame needs."""
        self.content: Final = Content(_fields(config, types))
        """The fields of messages that are needed."""
        self._task = config.task
        self._topics = [topic for topic in types if self.content.fields[topic]]
        self.needed: Final = tuple(index for index, topic in enumerate(types) if topic in self._topics)
        """The inputs of which a frame needs a message."""
        self.vectors: Final = {
            feature.name: [VectorSource(source, types[source.topic]) for source in feature.sources]
            for feature in config.features
            if not feature.is_video
        }
        """The sources of each feature that is a vector."""
        self.pictures: Final = {
            feature.name: PictureSource(feature.sources[0].topic, types[feature.sources[0].topic])
            for feature in config.features
            if feature.is_video
        }
        """The source of each feature that is a video."""
        sources = [source for each in self.vectors.values() for source in each]
        tasks = [] if isinstance(config.task, str) else [config.task.topic]
        self._numeric = list(dict.fromkeys([*(each.source.topic for each in sources), *tasks]))
        self._names = [feature.name for feature in config.features]

    def read(self, table: pa.Table) -> Iterator[FrameSet]:
        """Yield the sets of a table that can be frames. Raises BagError for a value that no frame can have."""
        is_whole = np.all([table[topic].is_valid().to_numpy() for topic in self._topics], axis=0)
        places = np.flatnonzero(is_whole)
        self.complete += len(places)
        self.unusable[INCOMPLETE] += len(table) - len(places)
        if not len(places):
            return
        # Pictures are read where they are: a copy of them would cost more than all else here.
        chosen = table.select(self._numeric).take(pa.array(places))
        vectors = [_rows(sources, chosen) for sources in self.vectors.values()]
        is_finite = np.all([np.isfinite(rows).all(axis=1) for rows in vectors], axis=0)
        self.unusable[NOT_FINITE] += len(places) - int(is_finite.sum())
        tasks = self._tasks(chosen)
        stamps = table["stamp"].cast(pa.int64()).to_numpy()
        for number in np.flatnonzero(is_finite).tolist():
            place = int(places[number])
            try:
                pictures = tuple(each.pixels(table[each.topic][place]) for each in self.pictures.values())
            except FrameError:
                self.unusable[NO_IMAGE] += 1
                continue
            yield FrameSet(int(stamps[place]), tuple(rows[number] for rows in vectors), pictures, tasks[number])

    def features(self) -> dict[str, dict[str, Any]]:
        """Return each column's dtype, shape and names, in the order of the file; known once there was a set."""
        features: dict[str, dict[str, Any]] = {}
        for name in self._names:
            if name in self.pictures:
                names, shape = ["height", "width", "channels"], list(self.pictures[name].shape)
                features[name] = {"dtype": "video", "shape": shape, "names": names}
            else:
                names = joined_names(self.vectors[name])
                features[name] = {"dtype": "float32", "shape": [len(names)], "names": names}
        return features

    def _tasks(self, table: pa.Table) -> Sequence[str]:
        if isinstance(self._task, str):
            return [self._task] * len(table)
        found = field_of(_messages(table, self._task.topic), self._task)
        if not pa.types.is_string(found.type):
            raise BagError(f"{self._task} is {found.type}, expected a string")
        texts: list[str] = found.to_pylist()
        return texts


def _rows(sources: Sequence[VectorSource], table: pa.Table) -> np.ndarray[Any, Any]:
    rows = [each.rows(_messages(table, each.source.topic)) for each in sources]
    with np.errstate(over="ignore"):
        # A value beyond float32 becomes infinite, and is reported as such.
        return np.concatenate(rows, axis=1).astype(np.float32)


def _messages(table: pa.Table, topic: str) -> pa.StructArray:
    column = table[topic]
    return column.chunk(0) if column.num_chunks == 1 else pa.concat_arrays(column.chunks)


def _fields(config: LerobotConfig, types: dict[str, str]) -> dict[str, list[str]]:
    """Return which fields are read of each input: none of an input that no feature needs."""
    fields: dict[str, dict[str, None]] = {topic: {} for topic in types}
    sources = [source for feature in config.features for source in feature.sources]
    sources += [] if isinstance(config.task, str) else [config.task]
    for source in sources:
        asked = fields[source.topic]
        if source.field is None:
            asked |= dict.fromkeys(FIELDS.get(types[source.topic], ()))
        else:
            asked[source.field] = None
            if has_joint_names(types[source.topic], source.field):
                asked[NAME] = None
    return {topic: list(asked) for topic, asked in fields.items()}
