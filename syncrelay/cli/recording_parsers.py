"""The words that the commands on recordings take; see parsers.py."""

from typing import Final

from syncrelay.cli.fleet_options import add_fleet_options
from syncrelay.cli.parser import Parser, output, seed


def analyze() -> Parser:
    """Return the parser of `syncrelay analyze`."""
    parser = Parser(
        "syncrelay analyze",
        example="syncrelay analyze drive.mcap --config fusion.yaml",
        description="Measures a recording without ROS: rates, gaps, faulty stamps, offsets; what the groups of a file "
        "make of it, and why; and the values that would fit. With BAG alone it lists what the recording holds. "
        "Each of several recordings is measured by itself, on all cores. "
        "Exit code 1 if a required topic, or part of a recording, is missing.",
    )
    parser.add_argument("bag", metavar="BAG", help="a recording, as for replay")
    parser.add_argument(
        "more", metavar="BAG|TOPIC", nargs="*", help="more recordings; topics to match, if there is no file yet"
    )
    parser.add_argument("--config", metavar="FILE", action="append", help="the file with the groups")
    parser.add_argument(
        "--write", metavar="NEW", type=output, help="write the file with the suggested values; keeps its comments"
    )
    parser.add_argument(
        "--html", metavar="REPORT", type=output, help="write a report with charts: one HTML file, opens offline"
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print all figures as JSON; of several recordings, each in one line; with --into the rows of its table",
    )
    parser.add_argument(
        "--robot",
        metavar="PATTERN",
        help="with --into: where in a path the robot's name is, as in '{robot}/{day}/*.mcap'; default: the first folder"
        " in which paths differ",
    )
    add_fleet_options(parser)
    return parser


def replay() -> Parser:
    """Return the parser of `syncrelay replay`."""
    parser = Parser(
        "syncrelay replay",
        example="syncrelay replay drive.mcap --config fusion.yaml -o sets.mcap",
        description="Runs the groups of a file on a recording, without ROS, and says what became of every message. "
        "The sets are those that the relay would have published. Exit code 1 if a required topic, or part of "
        "the recording, is missing.",
    )
    parser.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        help="a rosbag2 folder, or an MCAP, sqlite3 or ROS 1 bag file, compressed or not; several are read as one",
    )
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        required=True,
        help="the file with the groups, or a directory of files; may be repeated",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        type=output,
        help="write the sets as a recording: OUT.mcap, or OUT as a rosbag2 folder",
    )
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each set")
    parser.add_argument("--drops", action="store_true", help="print a line of JSON for each message that is dropped")
    parser.add_argument(
        "--what-if",
        metavar="FAULT",
        action="append",
        default=[],
        help="lay a fault over the recording, such as 'late: TOPIC 80ms' or 'drop: TOPIC 10%% from 12s'; also offset,"
        " drift, dead; may be repeated",
    )
    parser.add_argument("--seed", metavar="N", type=seed, default=0, help="with --what-if: which messages are lost (0)")
    add_fleet_options(parser)
    return parser


IMAGE_FORMATS: Final = ("png", "jpeg")
"""What --images can make of an image."""


def export() -> Parser:
    """Return the parser of `syncrelay export`."""
    parser = Parser(
        "syncrelay export",
        example="syncrelay export drive.mcap --config fusion.yaml -o dataset",
        description="Writes the sets that the groups of a file make of recordings as a dataset: in Parquet, a row a "
        "set, with the messages decoded. They are the sets of `syncrelay replay`. Exit code 1 if a recording lacks a "
        "required topic, or part of it is missing or cannot be read.",
    )
    parser.add_argument("bags", metavar="BAG", nargs="+", help="a recording as for replay; each is exported by itself")
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        required=True,
        help="the file with the groups, or a directory of files; may be repeated",
    )
    parser.add_argument(
        "--format",
        choices=("parquet", "mcap", "lerobot"),
        default="parquet",
        metavar="FORMAT",
        help="parquet (default): BAG/GROUP.parquet in FOLDER; mcap: the sets as a recording, as replay -o writes them;"
        " lerobot: FOLDER is one LeRobotDataset v3.0, as `export:` in the file says",
    )
    parser.add_argument(
        "--group", metavar="NAME", action="append", default=[], help="export this group only; may be repeated"
    )
    parser.add_argument(
        "--fields",
        metavar="TOPIC:FIELD,...",
        action="append",
        default=[],
        help="of this input's messages write these fields only, such as /imu/data:linear_acceleration,header.stamp; may"
        " be repeated",
    )
    parser.add_argument(
        "--images",
        metavar="[TOPIC=]FORMAT",
        action="append",
        default=[],
        help="write images as png or jpeg instead of raw pixels: those of this input, or all that no --images names;"
        " may be repeated, as in --images jpeg --images /depth=png",
    )
    parser.add_argument("--raw", action="store_true", help="write each message as the CDR bytes that were recorded")
    add_fleet_options(parser, "-o", "--output")
    return parser
