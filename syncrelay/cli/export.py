"""`syncrelay export BAG... --config FILE -o FOLDER`: the matched sets of recordings as datasets."""

from argparse import Namespace
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Final, Self, cast

from syncrelay.cli.export_lerobot import export_lerobot
from syncrelay.cli.fleet import do_on_many, engine_of
from syncrelay.cli.fleet_tasks import ReplayTask, about, counts_of, few_sets
from syncrelay.cli.parser import Parser
from syncrelay.cli.reading import eased_collector
from syncrelay.cli.recording_parsers import IMAGE_FORMATS
from syncrelay.cli.stop import StopRequest
from syncrelay.config import Config, load
from syncrelay.config.units import parse_duration_text
from syncrelay.config.wording import all_of, did_you_mean
from syncrelay.errors import BagError, UsageError
from syncrelay.recordings.bag import Recording, open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.bag.replay import Replay
from syncrelay.recordings.bag.stretch_replay import StretchReplay, run_stretch
from syncrelay.recordings.bag.stretches import Stretch, StretchResult, cut, lead_in, total
from syncrelay.recordings.datasets.images import ImageFormat
from syncrelay.recordings.datasets.parquet import SUFFIX, write_parquet
from syncrelay.recordings.datasets.reading import SetsOf, resolved
from syncrelay.recordings.datasets.tables import Content
from syncrelay.recordings.fleet.stretched import InStretches, Place
from syncrelay.recordings.fleet.task import JSON, Source, fingerprint_of, what_decides_sets

# Below, reading what leads in would take all the time.
_SHORTEST_NS: Final = 1_000_000_000


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay export`."""
    parser.refuse_repeated(arguments.config)
    if arguments.into is None:
        parser.error("the following arguments are required: -o/--output")
    if arguments.raw and (arguments.fields or arguments.images):
        parser.error("--raw keeps each message as it is: --fields and --images do not go with it")
    if arguments.stretch is not None and arguments.format != "parquet":
        parser.error(f"--stretch goes with --format parquet: --format {arguments.format} does not cut recordings")
    config = _of_groups(load(*arguments.config), arguments.group)
    if arguments.format == "mcap":
        if arguments.raw or arguments.fields or arguments.images:
            parser.error("--fields, --images and --raw are for tables: --format mcap writes whole messages")
        return do_on_many(ReplayTask.of(config, (), 0), arguments.bags, arguments)
    if arguments.format == "lerobot":
        if arguments.raw or arguments.fields or arguments.images:
            parser.error("--fields, --images and --raw are for tables: `export:` in the file says what LeRobot gets")
        return export_lerobot(config, arguments.bags, arguments)
    if arguments.images:
        # In a worker it would be a bug.
        import_module("PIL.Image")
    by_topic, others = _formats(arguments.images)
    content = Content(
        resolved(_parsed(arguments.fields), config), resolved(by_topic, config), others, raw=arguments.raw
    )
    stretch_ns = _length(arguments.stretch)
    task = ParquetTask.of(config, content, stretch_ns)
    engine = None if stretch_ns is None else InStretches(engine_of(arguments), task)
    return do_on_many(task, arguments.bags, arguments, engine=engine)


@dataclass(frozen=True, slots=True)
class ParquetTask:
    """Writes the sets of a recording as a Parquet file for each group; see Task. Facts are the counts of each input."""

    config: Config
    content: Content
    stretch_ns: int | None
    """How long the stretches are, each of which has files of its own; None: recordings are not cut."""
    decided_by: str

    @classmethod
    def of(cls, config: Config, content: Content, stretch_ns: int | None) -> Self:
        """Return the task of a file."""
        fields: dict[str, JSON] = {topic: list(paths) for topic, paths in content.fields.items()}
        groups: list[JSON] = [group.name for group in config.groups]
        options: dict[str, JSON] = {
            "format": "parquet",
            "groups": groups,
            "fields": fields,
            "images": dict(content.images),
            "other_images": content.other_images,
            "raw": content.raw,
            "stretch_ns": stretch_ns,
        }
        return cls(
            config,
            content,
            stretch_ns,
            fingerprint_of("export", config=what_decides_sets(config.groups), options=options),
        )

    def fingerprint(self) -> str:
        """See Task."""
        return self.decided_by

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with self._opened(source) as (recording, bindings):
            sets = SetsOf(bindings, self.content, name=source.name)
            replay = Replay(recording, bindings, listeners=sets.listeners)
            write_parquet(sets, replay.steps(), folder, ending=SUFFIX if self.stretch_ns is None else _ending(1))
            results = replay.results()
            facts = {**about(recording, bindings, more=sets.faults()), **few_sets(recording, bindings, results)}
            return {**facts, "groups": [counts_of(result) for result in results]}

    def cut(self, source: Source) -> tuple[Sequence[Stretch], dict[str, JSON]]:
        """See LongTask."""
        with self._opened(source) as (recording, bindings):
            length = recording.end - recording.begin if self.stretch_ns is None else self.stretch_ns
            stretches = cut(recording, length_ns=max(1, length), lead_in_ns=lead_in(bindings))
            return stretches, about(recording, bindings)

    def scout(self, source: Source, stretch: Stretch) -> StretchResult:
        """See LongTask."""
        with self._opened(source) as (recording, bindings):
            return run_stretch(recording, bindings, stretch)

    def write(self, source: Source, place: Place, folder: Path) -> StretchResult:
        """See LongTask."""
        with self._opened(source) as (recording, bindings):
            sets = SetsOf(bindings, self.content, name=source.name, before=place.sets)
            replay = StretchReplay(recording, bindings, place.stretch, listeners=sets.listeners, after=place.after)
            write_parquet(sets, replay.steps(), folder, ending=_ending(place.number))
            if faults := [*recording.faults, *sets.faults()]:
                # Those of several stretches would have to be made sentences on the whole.
                raise BagError(faults[0])
            return replay.result()

    def facts(self, results: Sequence[StretchResult]) -> dict[str, JSON]:
        """See LongTask."""
        return {"groups": [counts_of(result) for result in total(results)]}

    @contextmanager
    def _opened(self, source: Source) -> Iterator[tuple[Recording, Sequence[GroupBinding]]]:
        with closing(open_recording(source.words)) as recording, eased_collector():
            yield recording, bind(self.config, recording)


def _ending(number: int) -> str:
    """Return what follows a group's name in the file of a stretch; the same number of digits keeps them sorted."""
    return f"-{number:04}{SUFFIX}"


def _length(text: str | None) -> int | None:
    """Return the nanoseconds of --stretch."""
    if text is None:
        return None
    try:
        length, _ = parse_duration_text(text)
    except ValueError as error:
        raise UsageError(f"--stretch {text}: {error}") from error
    if length < _SHORTEST_NS:
        raise UsageError(f"--stretch {text}: expected 1s or more, as each stretch is a file; 10min is usual")
    return length


def _of_groups(config: Config, names: Sequence[str]) -> Config:
    """Return a file with these of its groups alone, all where none is named."""
    known = [group.name for group in config.groups]
    for name in names:
        if name not in known:
            raise UsageError(f"--group {name}: no such group{did_you_mean(name, known)}; the file has {all_of(known)}")
    return replace(config, groups=tuple(group for group in config.groups if not names or group.name in names))


def _parsed(words: Sequence[str]) -> dict[str, list[str]]:
    """Return the fields of each input from words such as /imu/data:linear_acceleration,angular_velocity."""
    fields: dict[str, list[str]] = {}
    for word in words:
        topic, colon, paths = word.partition(":")
        named = [path.strip() for path in paths.split(",")]
        if not colon or not topic or not all(named):
            raise UsageError(f"--fields {word}: expected TOPIC:FIELD,FIELD, such as /imu/data:linear_acceleration")
        fields.setdefault(topic, []).extend(named)
    return fields


def _formats(words: Sequence[str]) -> tuple[dict[str, ImageFormat], ImageFormat | None]:
    """Return what the images of each named input become and what all others do, from words as /depth=png and jpeg."""
    formats: dict[str, ImageFormat] = {}
    for word in words:
        topic, equals, found = word.rpartition("=")
        if found not in IMAGE_FORMATS or bool(topic) != bool(equals):
            raise UsageError(f"--images {word}: expected png or jpeg, or TOPIC=png or TOPIC=jpeg")
        if topic in formats:
            raise UsageError(f"--images {word}: a format is named twice for {topic or 'all images'}: name one")
        formats[topic] = cast("ImageFormat", found)
    others = formats.pop("", None)
    return formats, others
