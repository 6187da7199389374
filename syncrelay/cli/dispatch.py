"""From the words of the command line to a command and its exit code."""

import os
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from syncrelay.cli.boundary import DONE, USAGE, put, say
from syncrelay.cli.parser import Parser
from syncrelay.cli.stop import StopRequest
from syncrelay.errors import UsageError

_USAGE: Final = """\
usage: syncrelay --config FILE [option ...] [--ros-args ...]
       syncrelay COMMAND ..."""
_ABOUT: Final = "Matches ROS 2 messages by time, as a YAML file says, and republishes each matched set."
_COMMANDS_HELP: Final = """\
commands:
  validate FILE...      check files and report everything that is wrong with them
  schema                print the JSON Schema of the file, for editors
  replay BAG...         show what a file makes of a recording; write its outputs as one
  init --from-bag BAG   propose a file for a recording, or with --from-graph for what is published
  analyze BAG           measure a recording, and suggest the values that fit
  demo                  show it all on a simulated rig, without a robot
  doctor                tell what can go wrong before a message flows
  top                   watch a running relay, here or on another machine
  reload                have a running relay read its file again
  healthcheck           tell whether the relay receives, by its heartbeat
  syncrelay COMMAND --help says more

exit codes:
  0 done, 1 the file or data is at fault, 2 wrong usage, 69 ROS cannot be used here, 70 a bug in syncrelay,
  130 interrupted"""


def dispatch(words: Sequence[str], *, stop: StopRequest) -> int:
    """Run what the command line asks for; raises UsageError where it makes no sense."""
    if not words:
        say(_relay_parser().format_help().rstrip("\n"))
        return USAGE
    first, *rest = words
    if first == "help":
        return _relay(["--help"], stop)
    if first.startswith("-"):
        return _relay(words, stop)
    command = _COMMANDS.get(first)
    if command is None:
        raise UsageError(_unknown_command(first))
    return command(rest, stop)


def _relay_parser() -> Parser:
    parser = Parser("syncrelay", description=_ABOUT, usage=_USAGE.removeprefix("usage: "), epilog=_COMMANDS_HELP)
    options = parser.add_argument_group("the relay")
    options.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        default=[],
        help="relay what FILE says until Ctrl-C or SIGTERM; given several times, what all the files say together",
    )
    options.add_argument(
        "--group", metavar="NAME", action="append", default=[], help="relay this group only; may be repeated"
    )
    options.add_argument("--watch", action="store_true", help="read FILE again when it changes, and not only at SIGHUP")
    options.add_argument(
        "--explain",
        metavar="N",
        type=_positive,
        help="look for N seconds without publishing, then print how every group fares and why; exit code 1 unless all"
        " are healthy",
    )
    options.add_argument(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        default="info",
        metavar="LEVEL",
        help="debug, info (default), warning or error",
    )
    options.add_argument(
        "--log-format",
        choices=("text", "json"),
        default="text",
        metavar="FORMAT",
        help="text (default), or json: one object a line",
    )
    options.add_argument(
        "--ros-args", action="store_true", help="what follows goes to ROS as it is, e.g. -r __ns:=/robot1"
    )
    _add_help(parser)
    parser.add_argument("--version", action="store_true", help="print the version")
    return parser


def _relay(words: Sequence[str], stop: StopRequest) -> int:
    parser = _relay_parser()
    own, ros_args = _split_at_ros_args(words)
    arguments = parser.read(own)
    if arguments.help:
        return _print(parser.format_help())
    if arguments.version:
        return _print(_version())
    if not arguments.config:
        parser.error("--config FILE is missing")
    _refuse_twice(parser, arguments.config)
    from syncrelay.cli.run import run

    return run(
        arguments.config,
        arguments.group,
        arguments.log_level,
        arguments.log_format,
        ros_args,
        explain_s=arguments.explain,
        watch=arguments.watch,
        stop=stop,
    )


def _validate(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay validate",
        description="Checks files without ROS: every error at once, each at its line, with the nearest valid word.\n"
        "Message types are checked where ROS is installed; that a package of theirs is not is a note. Exit code 1 if\n"
        "a file has an error.",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", help="a YAML file, - for standard input")
    parser.add_argument(
        "--together", action="store_true", help="check the files as one, as the relay takes them: --config FILE ..."
    )
    parser.add_argument(
        "--format",
        choices=("text", "json", "github"),
        default="text",
        metavar="FORMAT",
        help="text (default), json, or github: annotations for a workflow",
    )
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    _refuse_twice(parser, arguments.files if arguments.together else [each for each in arguments.files if each == "-"])
    from syncrelay.cli.validate import validate

    return validate([arguments.files] if arguments.together else [[file] for file in arguments.files], arguments.format)


def _schema(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay schema",
        description="Prints the JSON Schema (draft 7) of the file, with which editors complete and check it.",
    )
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    parser.read(words)
    from syncrelay.cli.schema import schema

    return schema()


def _replay(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay replay",
        description="Feeds a recording to the groups of a file, without ROS, and prints where every message went: the\n"
        "sets are those that the relay would have given. Exit code 1 if a required topic is not in the recording.",
    )
    parser.add_argument(
        "bags",
        metavar="BAG",
        nargs="+",
        help="a rosbag2 folder, an MCAP, sqlite3 or ROS 1 bag file, also compressed; several are read as one",
    )
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        required=True,
        help="the file whose groups get the messages; may be repeated",
    )
    parser.add_argument(
        "-o", "--output", metavar="OUT", help="write the sets as a recording: OUT.mcap, or OUT as a rosbag2 folder"
    )
    parser.add_argument("--json", action="store_true", help="print a line of JSON for each set")
    parser.add_argument("--drops", action="store_true", help="print a line of JSON for each message that is dropped")
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    _refuse_twice(parser, arguments.config)
    from syncrelay.cli.replay import Wanted, replay

    return replay(arguments.bags, arguments.config, Wanted(arguments.json, arguments.drops, arguments.output))


def _analyze(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay analyze",
        description="Measures a recording without ROS: rates, gaps, faults of stamps, offsets; what the groups of a\n"
        "file make of it, and why; and the values that would fit. BAG alone: what is in it, and what to type next.\n"
        "Exit code 1 if a required topic is not in it.",
    )
    parser.add_argument("bag", metavar="BAG", help="a recording, as for replay")
    parser.add_argument("topics", metavar="TOPIC", nargs="*", help="topics to match, where there is no file yet")
    parser.add_argument("--config", metavar="FILE", action="append", help="the file whose groups are looked at")
    parser.add_argument("--write", metavar="NEW", help="write the file with the suggested values, comments kept")
    parser.add_argument(
        "--html", metavar="REPORT", help="write all of it with drawings, as one HTML file to open offline"
    )
    parser.add_argument("--json", action="store_true", help="print all figures as JSON")
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    from syncrelay.cli.analyze import Asked, analyze_bag

    config, *others = arguments.config or [None]
    if others:
        parser.error("--config is here several times: analyze takes one file, of which --write makes a better one")
    asked = Asked(config, tuple(arguments.topics), arguments.write, arguments.html, arguments.json)
    return analyze_bag(arguments.bag, asked)


def _init(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay init",
        description="Proposes a file: groups of the topics that a recording or the ROS graph has, types, and values\n"
        "that fit, with what was measured as comments. The file gives sets of what it was made from.",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--from-bag", metavar="BAG", help="a recording, as for replay; needs no ROS")
    source.add_argument("--from-graph", action="store_true", help="what is published now, listened to for a while")
    parser.add_argument("--seconds", metavar="N", type=_positive, help="with --from-graph: listen for N s (10)")
    parser.add_argument("-o", "--output", metavar="NEW", help="write the file; without it, it is printed")
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    from syncrelay.cli.init import init_from_bag, init_from_graph

    if arguments.from_graph:
        return init_from_graph(arguments.seconds or 10.0, arguments.output)
    if arguments.seconds is not None:
        parser.error("--seconds N is for how long --from-graph listens, and --from-graph is missing")
    return init_from_bag(arguments.from_bag, arguments.output)


def _demo(words: Sequence[str], stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay demo",
        description="Starts a simulated camera, lidar and IMU, relays them, and draws what happens. Ctrl-C ends it.",
    )
    parser.add_argument("--seconds", metavar="N", type=_positive, help="once its sensors are up, end after N seconds")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="seed of jitter, latency and drops (0)")
    parser.add_argument("--show-config", action="store_true", help="print the file that the demo relays")
    parser.add_argument(
        "--record",
        metavar="OUT",
        help="write what the rig sends in N seconds (30) as a recording, at once and without ROS: OUT.mcap, or OUT as a"
        " rosbag2 folder",
    )
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    if arguments.record is not None:
        from syncrelay.cli.demo_recording import record

        return record(arguments.record, arguments.seconds, arguments.seed)
    from syncrelay.cli.demo import demo

    return demo(arguments.seconds, arguments.seed, arguments.show_config, stop=stop)


def _doctor(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay doctor",
        description="Tells what can go wrong before a message flows: what is so, what follows, what to do.\n"
        "Exit code 1 if something is to be mended.",
    )
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        default=[],
        help="check FILE too, and whether its types can be used here; may be repeated",
    )
    parser.add_argument(
        "--live", action="store_true", help="join the graph: publishers, types, QoS, stamps of the topics of FILE"
    )
    parser.add_argument("--seconds", metavar="N", type=_positive, help="with --live: look for N s (5)")
    parser.add_argument("--json", action="store_true", help="print it as JSON, for programs")
    parser.add_argument("--ros-args", action="store_true", help="what follows is what the relay gets: remaps and such")
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    own, ros_args = _split_at_ros_args(words)
    arguments = parser.read(own)
    from syncrelay.cli.doctor import doctor

    if arguments.seconds and not arguments.live:
        parser.error("--seconds N is for how long --live looks at the graph, and --live is missing")
    _refuse_twice(parser, arguments.config)
    live_s = (arguments.seconds or 5.0) if arguments.live else None
    output_format = "json" if arguments.json else "text"
    return doctor(arguments.config, live_s, output_format, ros_args)


def _top(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay top",
        description="Shows a running relay live: groups, inputs, recent sets, and what is wrong with them.\n"
        "Without --url it is the one on this machine, of several the one you choose.\n"
        "Exit code 1 if there is none.",
    )
    parser.add_argument(
        "--url", metavar="URL", help="where it is: a host, host:port or URL, such as robot or http://robot:9464"
    )
    parser.add_argument("--once", action="store_true", help="print the state as text and end")
    parser.add_argument(
        "--json", action="store_true", help="with --once: print the state as JSON, as the relay tells it"
    )
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    if arguments.json and not arguments.once:
        parser.error("--json goes with --once")
    from syncrelay.cli.top import Output, top

    output = Output.JSON if arguments.json else Output.TEXT if arguments.once else Output.SCREEN
    return top(arguments.url, output)


def _reload(words: Sequence[str], _stop: StopRequest) -> int:
    parser = Parser(
        "syncrelay reload",
        description="Has the relay of this machine read its file again: groups that did not change go on, with all\n"
        "that they hold. With an error in the file it keeps its running configuration, and the exit code is 1.",
    )
    parser.add_argument("--url", metavar="URL", help="which relay, of several: its host:port or URL")
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    arguments = parser.read(words)
    from syncrelay.cli.reload import reload

    return reload(arguments.url)


def _healthcheck(words: Sequence[str], _stop: StopRequest) -> int:
    from syncrelay.cli.heartbeat import VARIABLE, healthcheck

    parser = Parser(
        "syncrelay healthcheck",
        description="Tells whether the relay's receive loop turns, by the heartbeat that the relay writes into the\n"
        f"file that {VARIABLE} names. Exit code 1 if it does not.",
    )
    _add_help(parser)
    if _asks_for_help(words):
        return _print(parser.format_help())
    parser.read(words)
    return healthcheck()


_COMMANDS: Final[dict[str, Callable[[Sequence[str], StopRequest], int]]] = {
    "validate": _validate,
    "schema": _schema,
    "init": _init,
    "replay": _replay,
    "analyze": _analyze,
    "demo": _demo,
    "doctor": _doctor,
    "top": _top,
    "reload": _reload,
    "healthcheck": _healthcheck,
}


def _add_help(parser: Parser) -> None:
    parser.add_argument("-h", "--help", action="store_true", help="print this help")


def _asks_for_help(words: Sequence[str]) -> bool:
    return "-h" in words or "--help" in words


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise ArgumentTypeError(f"expected a number above 0, found {text}")
    return number


def _split_at_ros_args(words: Sequence[str]) -> tuple[Sequence[str], Sequence[str]]:
    if "--ros-args" not in words:
        return words, ()
    at = list(words).index("--ros-args")
    return words[:at], words[at + 1 :]


def _refuse_twice(parser: Parser, files: Sequence[str]) -> None:
    """Refuse a file that is to run together with itself, however it is called; standard input is read once too."""
    named: dict[str, str] = {}
    for file in files:
        place = file if file == "-" else os.path.realpath(file)
        if place in named:
            same = f"{file} is named twice" if named[place] == file else f"{named[place]} and {file} are the same file"
            parser.error(f"{same}: name each file once")
        named[place] = file


def _unknown_command(word: str) -> str:
    from syncrelay.config.wording import did_you_mean

    if word.endswith((".yaml", ".yml")) or Path(word).is_file():
        return (
            f"{word} is not a command\n  syncrelay --config {word}     to relay what it says\n"
            f"  syncrelay validate {word}     to check it"
        )
    return f"unknown command {word}{did_you_mean(word, _COMMANDS)}\n  syncrelay --help lists the commands"


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"syncrelay {version('syncrelay')}"
    except PackageNotFoundError:
        return "syncrelay (not installed)"


def _print(text: str) -> int:
    put(text.rstrip("\n"))
    return DONE
