"""Sets of a table as frames need them: all vectors, all pictures and the task; or not at all."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import pyarrow as pa

from syncrelay.config import ExportFeature, LerobotConfig
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
    """What a set gives to its frames: vectors and pictures in the order of the features."""

    stamp: int
    vectors: tuple[np.ndarray[Any, Any], ...]
    pictures: tuple[np.ndarray[Any, Any], ...]
    task: str


class _Vector(NamedTuple):
    feature: ExportFeature
    sources: tuple[VectorSource, ...]


class FrameSets:
    """The sets of one group of a recording, as frames need them."""

    def __init__(self, config: LerobotConfig, binding: GroupBinding) -> None:
        """Raise BagError for an input that holds no images, and is to become a video."""
        types = {each.topic: each.config.type or "" for each in binding.inputs}
        self.unusable: Counter[str] = Counter()
        """How many sets can be no frame, by why."""
        self.complete = 0
        """How many sets have all messages that a frame needs."""
        self.content: Final = Content(_fields(config, types))
        """What is to be read of the messages."""
        self._task = config.task
        self._needed = [topic for topic in types if self.content.fields[topic]]
        self.needed: Final = tuple(index for index, topic in enumerate(types) if topic in self._needed)
        """The inputs of which a frame needs a message."""
        self._vectors = [
            _Vector(feature, tuple(VectorSource(source, types[source.topic]) for source in feature.sources))
            for feature in config.features
            if not feature.is_video
        ]
        self._pictures = [
            (feature, PictureSource(feature.sources[0].topic, types[feature.sources[0].topic]))
            for feature in config.features
            if feature.is_video
        ]
        self._features = config.features

    def read(self, table: pa.Table) -> Iterator[FrameSet]:
        """Yield the sets of a table that can be frames, in their order. Raises BagError for what no frame can be."""
        whole = np.all([table[topic].is_valid().to_numpy() for topic in self._needed], axis=0)
        places = np.flatnonzero(whole)
        self.complete += len(places)
        self.unusable[INCOMPLETE] += len(table) - len(places)
        if not len(places):
            return
        chosen = pa.array(places)
        vectors = [self._rows(each, table, chosen) for each in self._vectors]
        finite = np.all([np.isfinite(rows).all(axis=1) for rows in vectors], axis=0)
        self.unusable[NOT_FINITE] += len(places) - int(finite.sum())
        tasks = self._tasks(table, chosen)
        stamps = table["stamp"].cast(pa.int64()).to_numpy()
        for number in np.flatnonzero(finite).tolist():
            place = int(places[number])
            try:
                pictures = tuple(source.pixels(table[source.topic][place]) for _, source in self._pictures)
            except FrameError:
                self.unusable[NO_IMAGE] += 1
                continue
            rows = tuple(each[number] for each in vectors)
            yield FrameSet(int(stamps[place]), rows, pictures, tasks[number])

    def features(self) -> dict[str, dict[str, Any]]:
        """Return each column's dtype, shape and names, in the order of the file; known once there was a set."""
        shapes: dict[str, dict[str, Any]] = {}
        for feature, sources in self._vectors:
            names = joined_names(sources)
            shapes[feature.name] = {"dtype": "float32", "shape": [len(names)], "names": names}
        for feature, source in self._pictures:
            shapes[feature.name] = {
                "dtype": "video",
                "shape": list(source.shape),
                "names": ["height", "width", "channels"],
            }
        return {feature.name: shapes[feature.name] for feature in self._features}

    @property
    def vector_names(self) -> tuple[str, ...]:
        """The features that are vectors, as FrameSet has them."""
        return tuple(each.feature.name for each in self._vectors)

    @property
    def picture_names(self) -> tuple[str, ...]:
        """The features that are videos, as FrameSet has them."""
        return tuple(feature.name for feature, _ in self._pictures)

    def _rows(self, vector: _Vector, table: pa.Table, chosen: pa.Array) -> np.ndarray[Any, Any]:
        rows = [each.rows(_taken(table[each.source.topic], chosen)) for each in vector.sources]
        with np.errstate(over="ignore"):
            # What float32 cannot hold is infinite, and told as such.
            return np.concatenate(rows, axis=1).astype(np.float32)

    def _tasks(self, table: pa.Table, chosen: pa.Array) -> Sequence[str]:
        if isinstance(self._task, str):
            return [self._task] * len(chosen)
        found = field_of(_taken(table[self._task.topic], chosen), self._task)
        if not pa.types.is_string(found.type):
            raise BagError(f"{self._task} is {found.type}, expected a string")
        texts: list[str] = found.to_pylist()
        return texts


def _taken(column: pa.ChunkedArray, chosen: pa.Array) -> pa.StructArray:
    taken = column.take(chosen)
    return taken.chunk(0) if taken.num_chunks == 1 else pa.concat_arrays(taken.chunks)


def _fields(config: LerobotConfig, types: dict[str, str]) -> dict[str, list[str]]:
    """Return which fields are read of each input: none of one that no feature needs."""
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
