"""`syncrelay interfaces FILE...`: a package of messages that hold the sets of a file's groups."""

from argparse import Namespace

from syncrelay.cli.boundary import DONE, remark
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest


def parser() -> Parser:
    parser = Parser(
        "syncrelay interfaces",
        example="syncrelay interfaces fusion.yaml -o src/fusion_interfaces",
        description="Writes a ROS package with a message for each group of files that run together, in which `bundle` "
        "publishes the group's sets. Its README says how to build it, and shows a consumer. Needs no ROS.",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", help="a YAML file, a directory of them, or -")
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", help="write the package here (the package's name, in this folder)"
    )
    return parser


def command(parser: Parser, arguments: Namespace, _stop: StopRequest) -> int:
    from pathlib import Path

    from syncrelay.config import load
    from syncrelay.config.message_package import messages_of, package_of
    from syncrelay.config.message_package_files import files_of
    from syncrelay.config.source import shown_name
    from syncrelay.output_files import require_new, written_whole
    from syncrelay.urls import redacted

    parser.refuse_repeated(arguments.files)
    config = load(*arguments.files)
    package = package_of(config, Path(arguments.files[0]).stem)
    messages = messages_of(config, package)
    place = arguments.output or package
    require_new(place)
    with written_whole(place) as folder:
        (folder / "msg").mkdir(parents=True)
        for path, text in files_of(package, messages, source=Path(shown_name(arguments.files[0])).name):
            (folder / path).write_text(text, encoding="utf-8")
    remark(f"wrote {redacted(place)}: {', '.join(f'{package}/msg/{each.name}' for each in messages)}")
    return DONE
