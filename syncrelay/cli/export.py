"""`syncrelay export BAG... --config FILE -o FOLDER`: the matched sets of recordings as datasets."""

from argparse import Namespace
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Self, cast

from syncrelay.cli.export_lerobot import export_lerobot
from syncrelay.cli.fleet import do_on_many
from syncrelay.cli.fleet_tasks import ReplayTask, about, counts_of, few_sets
from syncrelay.cli.parser import Parser
from syncrelay.cli.reading import eased_collector
from syncrelay.cli.recording_parsers import IMAGE_FORMATS
from syncrelay.cli.stop import StopRequest
from syncrelay.config import Config, load
from syncrelay.config.wording import all_of, did_you_mean
from syncrelay.errors import UsageError
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.replay import Replay
from syncrelay.recordings.datasets.images import ImageFormat
from syncrelay.recordings.datasets.parquet import write_parquet
from syncrelay.recordings.datasets.reading import SetsOf, resolved
from syncrelay.recordings.datasets.tables import Content
from syncrelay.recordings.fleet.task import JSON, Source, fingerprint_of, what_decides_sets


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    """Run `syncrelay export`."""
    parser.refuse_repeated(arguments.config)
    if arguments.into is None:
        parser.error("the following arguments are required: -o/--output")
    if arguments.raw and (arguments.fields or arguments.images):
        parser.error("--raw keeps each message as it is: --fields and --images do not go with it")
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
    return do_on_many(ParquetTask.of(config, content), arguments.bags, arguments)


@dataclass(frozen=True, slots=True)
class ParquetTask:
    """Writes the sets of a recording as a Parquet file for each group; see Task. Facts are the counts of each input."""

    config: Config
    content: Content
    decided_by: str

    @classmethod
    def of(cls, config: Config, content: Content) -> Self:
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
        }
        return cls(
            config,
            content,
            fingerprint_of("export", config=what_decides_sets(config.groups), options=options),
        )

    def fingerprint(self) -> str:
        """See Task."""
        return self.decided_by

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with closing(open_recording(source.words)) as recording, eased_collector():
            bindings = bind(self.config, recording)
            sets = SetsOf(bindings, self.content, name=source.name)
            replay = Replay(recording, bindings, listeners=sets.listeners)
            write_parquet(sets, replay.steps(), folder)
            results = replay.results()
            facts = {**about(recording, bindings, more=sets.faults()), **few_sets(recording, bindings, results)}
            return {**facts, "groups": [counts_of(result) for result in results]}


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
