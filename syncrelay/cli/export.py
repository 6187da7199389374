"""`syncrelay export BAG... --config FILE -o FOLDER`: the matched sets of recordings as datasets."""

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

from syncrelay.cli.boundary import AT_FAULT, DONE, put, remark
from syncrelay.cli.many_options import add_many_options
from syncrelay.cli.parser import COMPRESSIONS, IMAGE_FORMATS, Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import UsageError
from syncrelay.printable import printable

if TYPE_CHECKING:
    from syncrelay.config import Config
    from syncrelay.recordings.bag.mcap_output import Compression
    from syncrelay.recordings.datasets.images import ImageFormat
    from syncrelay.recordings.fleet.run import Run
    from syncrelay.recordings.fleet.task import Source


def parser() -> Parser:
    parser = Parser(
        "syncrelay export",
        example="syncrelay export drive.mcap --config fusion.yaml -o dataset",
        description="Writes the sets that the groups of a file make of recordings as a dataset: in Parquet, a row a "
        "set, with the messages decoded. They are the sets of `syncrelay replay`. Exit code 1 if a recording lacks a "
        "required topic, or part of it is missing or cannot be read.",
    )
    parser.add_argument("bags", metavar="BAG", nargs="+", help="a recording as for replay; each is exported by itself")
    parser.add_repeatable(
        "--config", metavar="FILE", required=True, help="the file with the groups, or a directory of files"
    )
    parser.add_argument(
        "--format",
        choices=("parquet", "mcap", "lerobot"),
        default="parquet",
        metavar="FORMAT",
        help="parquet (default): BAG/GROUP.parquet in FOLDER; mcap: the sets as a recording, as replay -o writes them;"
        " lerobot: FOLDER is one LeRobotDataset v3.0, as `export:` in the file says",
    )
    parser.add_repeatable("--group", metavar="NAME", help="export this group only")
    parser.add_repeatable(
        "--fields",
        metavar="TOPIC:FIELD,...",
        help="of this input's messages write these fields only, such as /imu/data:linear_acceleration,header.stamp",
    )
    parser.add_repeatable(
        "--images",
        metavar="[TOPIC=]FORMAT",
        help="write images as png or jpeg instead of raw pixels: those of this input, or all that no --images names, as"
        " in --images jpeg --images /depth=png",
    )
    parser.add_argument("--raw", action="store_true", help="write each message as the CDR bytes that were recorded")
    parser.add_argument(
        "--compression",
        choices=COMPRESSIONS,
        metavar="HOW",
        help="how Parquet and MCAP are packed: zstd (default), lz4, or none, the quickest: raw pixels pack badly",
    )
    parser.add_argument(
        "-o",
        "--output",
        dest="into",
        required=True,
        metavar="FOLDER",
        help="do each recording by itself, unless its result is in FOLDER already; BAG may be a pattern, a folder, a"
        " URL, or @FILE that lists them",
    )
    add_many_options(parser)
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    parser.refuse_repeated(arguments.config)
    has_columns = bool(arguments.fields or arguments.images)
    if arguments.raw and has_columns:
        parser.error("--raw keeps each message as it is: --fields and --images do not go with it")
    if (arguments.raw or has_columns) and arguments.format != "parquet":
        whole = "--format mcap writes whole messages"
        why = whole if arguments.format == "mcap" else "`export:` in the file says what LeRobot gets"
        parser.error(f"--fields, --images and --raw are for tables: {why}")
    if arguments.compression and arguments.format == "lerobot":
        parser.error("--compression is for Parquet and MCAP: LeRobot's videos are packed already")
    from syncrelay.cli.many import do_on_many
    from syncrelay.cli.run import require_groups
    from syncrelay.config import load

    config = load(*arguments.config)
    require_groups(arguments.group, config, arguments.config)
    chosen = tuple(group for group in config.groups if not arguments.group or group.name in arguments.group)
    config = replace(config, groups=chosen)
    compression: Compression = arguments.compression or "zstd"
    if arguments.format == "mcap":
        from syncrelay.recordings.fleet.tasks import ReplayTask

        return do_on_many(ReplayTask.of(config, (), 0, compression), arguments.bags, arguments)
    if arguments.format == "lerobot":
        return _export_lerobot(config, arguments)
    from syncrelay.recordings.datasets.reading import resolved
    from syncrelay.recordings.datasets.tables import Content
    from syncrelay.recordings.fleet.export_tasks import ParquetTask

    by_topic, others = _formats(arguments.images)
    content = Content(
        resolved(_parsed(arguments.fields), config), resolved(by_topic, config), others, arguments.raw, compression
    )
    return do_on_many(ParquetTask.of(config, content), arguments.bags, arguments)


def _export_lerobot(config: "Config", arguments: Namespace) -> int:
    """Write a LeRobotDataset of all recordings into the folder of the arguments, from an episode of each."""
    from syncrelay.cli.many import do_on_many
    from syncrelay.config.wording import counted
    from syncrelay.output_files import local_path
    from syncrelay.recordings.fleet.export_tasks import EPISODES, LerobotTask, join, require_own
    from syncrelay.urls import redacted

    task = LerobotTask.of(config)
    path = local_path(arguments.into)
    if path is None:
        raise UsageError(f"{redacted(arguments.into)}: episodes are joined on this machine: name a folder of it")
    out = path.absolute()
    require_own(out)

    def finish(run: "Run", sources: "Sequence[Source]") -> int:
        facts = join(run, sources, out)
        for problem in facts["problems"]:
            remark(problem)
        episodes, frames = counted(facts["total_episodes"], "episode"), counted(facts["total_frames"], "frame")
        held, left_out = counted(facts["held"], "frame"), counted(facts["left_out"], "set")
        put(printable(f"{out}: {episodes} with {frames}; {held} repeated, {left_out} between frames left out"))
        return AT_FAULT if facts["problems"] else DONE

    into = Namespace(**{**vars(arguments), "into": str(out / EPISODES)})
    return do_on_many(task, arguments.bags, into, finish=finish)


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


def _formats(words: Sequence[str]) -> "tuple[dict[str, ImageFormat], ImageFormat | None]":
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
