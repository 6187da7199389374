"""The words that each command takes. Imports nothing slow: completion reads it at every press of TAB.

A metavar says what kind of word is expected, and so what completes it (syncrelay.cli.completion).
"""

from typing import Final

from syncrelay.cli.boundary import EXIT_CODES
from syncrelay.cli.parser import Parser, count, folded, output, positive

_RELAY_USAGE: Final = "syncrelay --config FILE [option ...] | syncrelay COMMAND ..."


def relay() -> Parser:
    """Return the parser of `syncrelay --config FILE`."""
    from syncrelay.cli.dispatch import commands_help

    exit_codes = f"exit codes: {', '.join(f'{code} {means}' for code, means in EXIT_CODES.items())}"
    parser = Parser(
        "syncrelay",
        example="syncrelay --config fusion.yaml",
        description="Matches ROS 2 messages by time, as a YAML file says, and republishes the sets.",
        usage=_RELAY_USAGE,
        epilog=f"commands:\n{commands_help()}\n\n{folded(exit_codes)}",
    )
    add = parser.add_argument
    add(
        "--config",
        metavar="FILE",
        action="append",
        default=[],
        help="run groups of FILE, or a directory; may be repeated",
    )
    add("--group", metavar="NAME", action="append", default=[], help="run this group only; may be repeated")
    add(
        "--watch",
        action="store_true",
        help="read FILE again when it changes, not only at SIGHUP",
    )
    add(
        "--log-level",
        choices=("debug", "info", "warning", "error"),
        default="info",
        metavar="LEVEL",
        help="debug, info (default), warning or error",
    )
    add("--log-format", choices=("text", "json"), default="text", metavar="FORMAT", help="text (default) or json")
    add("--ros-args", action="store_true", help="pass what follows to ROS, such as -r __ns:=/robot1")
    parser.add_argument("--version", action="store_true", help="print the version")
    return parser


def validate() -> Parser:
    """Return the parser of `syncrelay validate`."""
    parser = Parser(
        "syncrelay validate",
        example="syncrelay validate fusion.yaml",
        description="Checks files without ROS and shows every error at once, each at its line, with the nearest valid "
        "word. Message types are checked where ROS is installed; a package that is missing there is only a note. "
        "Exit code 1 if a file has an error.",
    )
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="a YAML file, a directory of files that run together, or - for standard input",
    )
    parser.add_argument(
        "--together", action="store_true", help="check the files as one, as the relay does: --config FILE ..."
    )
    parser.add_argument(
        "--format",
        choices=("text", "json", "github"),
        default="text",
        metavar="FORMAT",
        help="text (default), json, or github: annotations for a workflow",
    )
    return parser


def diff() -> Parser:
    """Return the parser of `syncrelay diff`."""
    parser = Parser(
        "syncrelay diff",
        example="syncrelay diff fusion.yaml wider.yaml",
        description="Says what a reload would do to a relay that runs OLD and reads NEW: which groups go on, are "
        "rebuilt, start and end, for which keys, and which subscriptions and publishers go and come. Needs no ROS. "
        "For files that run together, name a directory of them. "
        "Exit code 0 if nothing changes, 1 if something does or a file has an error.",
    )
    parser.add_argument("old", metavar="OLD", help="what the relay runs: a YAML file, a directory of them, or -")
    parser.add_argument("new", metavar="NEW", help="what it would read: a YAML file, a directory of them, or -")
    parser.add_argument("--json", action="store_true", help="print JSON, for programs")
    return parser


def graph() -> Parser:
    """Return the parser of `syncrelay graph`."""
    parser = Parser(
        "syncrelay graph",
        example="syncrelay graph fusion.yaml",
        description="Draws the groups of files that run together: which inputs each matches, how, and its outputs. "
        "With --url the drawing has what a running relay says: rates and findings. Needs no ROS.",
    )
    parser.add_argument("files", metavar="FILE", nargs="+", help="a YAML file, a directory of them, or -")
    parser.add_argument(
        "--format",
        choices=("mermaid", "dot", "svg"),
        default="mermaid",
        metavar="FORMAT",
        help="mermaid (default), for Markdown; dot, for Graphviz; svg, for browsers",
    )
    parser.add_argument("--url", metavar="URL", help="the relay that runs them: its host, host:port or URL")
    return parser


def init() -> Parser:
    """Return the parser of `syncrelay init`."""
    parser = Parser(
        "syncrelay init",
        example="syncrelay init --from-bag drive.mcap -o fusion.yaml",
        description="Proposes a file for a recording or for a live ROS graph: groups of its topics, their types, and "
        "values that fit, with what was measured as comments.",
    )
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--from-bag", metavar="BAG", help="a recording, as for replay; needs no ROS")
    source.add_argument("--from-graph", action="store_true", help="listen to what is being published now")
    parser.add_argument("--seconds", metavar="N", type=positive, help="with --from-graph: listen for N s (10)")
    parser.add_argument("-o", "--output", metavar="NEW", type=output, help="write the file here instead of printing it")
    return parser


def test() -> Parser:
    """Return the parser of `syncrelay test`."""
    parser = Parser(
        "syncrelay test",
        example="syncrelay test tests/fusion.yaml",
        description="Runs the tests of a configuration, without ROS: messages that are drawn, simulated or recorded go "
        "through the engine, and what comes of them is compared with what the test file expects. Exit code 1 if a case "
        "fails.",
    )
    parser.add_argument(
        "files", metavar="FILE", nargs="+", help="a test file, a directory of them, or - for standard input"
    )
    parser.add_argument(
        "--format",
        choices=("text", "junit", "json", "github"),
        default="text",
        metavar="FORMAT",
        help="text (default), junit, json, or github: annotations for a workflow",
    )
    parser.add_argument(
        "--update",
        action="store_true",
        help="replace the expectations in the test files with what was found",
    )
    return parser


def demo() -> Parser:
    """Return the parser of `syncrelay demo`."""
    parser = Parser(
        "syncrelay demo",
        example="syncrelay demo --seconds 30",
        description="Starts a simulated camera, lidar and IMU, relays them, and draws what happens. Ctrl-C ends it. "
        "Exit code 1 if a group produced no set.",
    )
    parser.add_argument("--seconds", metavar="N", type=positive, help="end N seconds after the sensors are up")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="seed of jitter, latency and drops (0)")
    parser.add_argument("--show-config", action="store_true", help="print the file that the demo relays, and exit")
    parser.add_argument(
        "--record",
        metavar="OUT",
        type=output,
        help="write what the sensors send in N seconds (30) as a recording, at once and without ROS: OUT.mcap, or OUT"
        " as a rosbag2 folder",
    )
    return parser


def doctor() -> Parser:
    """Return the parser of `syncrelay doctor`."""
    parser = Parser(
        "syncrelay doctor",
        example="syncrelay doctor --config fusion.yaml --live",
        description="Finds out why messages may not arrive: what is wrong, what follows from it, how to fix it. "
        "Exit code 1 if something must be fixed.",
    )
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        default=[],
        help="check FILE or the files of a directory too, and whether their types can be used here; may be repeated",
    )
    parser.add_argument(
        "--live",
        action="store_true",
        help="join the ROS graph and check the topics of FILE: publishers, types, QoS, stamps",
    )
    parser.add_argument("--seconds", metavar="N", type=positive, help="with --live: watch for N s (5)")
    parser.add_argument("--json", action="store_true", help="print JSON, for programs")
    parser.add_argument("--ros-args", action="store_true", help="ROS arguments as the relay gets them, such as remaps")
    return parser


def observe() -> Parser:
    """Return the parser of `syncrelay observe`."""
    parser = Parser(
        "syncrelay observe",
        example="syncrelay observe --config fusion.yaml --seconds 30",
        description="Tries a file beside a running robot: subscribes, publishes nothing, and shows live, as top does, "
        "what its groups make of what comes. Ends with what would have left, why not more, and the values that would "
        "fit. Exit code 1 unless all groups are healthy.",
    )
    parser.add_argument(
        "--config",
        metavar="FILE",
        action="append",
        required=True,
        help="the file to try, or a directory of files; may be repeated",
    )
    parser.add_argument(
        "--group", metavar="NAME", action="append", default=[], help="try this group only; may be repeated"
    )
    parser.add_argument("--seconds", metavar="N", type=positive, help="end after N s, and print text only")
    parser.add_argument("--json", action="store_true", help="print JSON at the end, for programs")
    parser.add_argument(
        "--write", metavar="NEW", type=output, help="write the file with the suggested values; keeps its comments"
    )
    parser.add_argument("--ros-args", action="store_true", help="ROS arguments as the relay gets them, such as remaps")
    return parser


def top() -> Parser:
    """Return the parser of `syncrelay top`."""
    parser = Parser(
        "syncrelay top",
        example="syncrelay top --url robot:9464",
        description="Shows a running relay live: its groups, their inputs, their last sets, and what is wrong. "
        "Without --url it shows the relay of this machine, and asks which if there are several. "
        "Exit code 1 if no relay answers.",
    )
    parser.add_argument(
        "--url", metavar="URL", help="the relay's host, host:port or URL, such as robot or http://robot:9464"
    )
    parser.add_argument("--once", action="store_true", help="print the state once as text, and exit")
    parser.add_argument("--json", action="store_true", help="with --once: print the state as JSON")
    return parser


def tap() -> Parser:
    """Return the parser of `syncrelay tap`."""
    from syncrelay.sync.messages import DropReason

    parser = Parser(
        "syncrelay tap",
        example="syncrelay tap front --reason late",
        description="Prints each set and each dropped message of a running relay as it leaves, a line each, until "
        "Ctrl-C. It subscribes to nothing: the relay tells it over HTTP. For each set it shows how much later "
        "than the earliest stamp each input's stamp is, offsets included. The relay never waits: a reader that is too "
        "slow loses lines and is told how many.",
    )
    parser.add_argument("group", metavar="GROUP", nargs="?", help="print this group only")
    parser.add_argument(
        "--url", metavar="URL", help="which relay, if there are several: its host, host:port or URL, as for top"
    )
    parser.add_argument("--json", action="store_true", help="print lines of JSON, as replay does")
    parser.add_argument("--drops", action="store_true", help="print dropped messages only")
    parser.add_argument(
        "--input",
        metavar="TOPIC",
        action="append",
        default=[],
        help="print only sets and drops of TOPIC; may be repeated",
    )
    parser.add_argument(
        "--reason",
        metavar="REASON",
        action="append",
        default=[],
        choices=tuple(each.value for each in DropReason),
        help="print messages dropped for this reason, such as late or overflow; may be repeated",
    )
    parser.add_argument("-n", "--number", metavar="N", type=count, help="end after N lines")
    return parser


def reload() -> Parser:
    """Return the parser of `syncrelay reload`."""
    parser = Parser(
        "syncrelay reload",
        example="syncrelay reload --url localhost:9464",
        description="Makes the relay on this machine read its file again. Groups that did not change keep running and "
        "lose nothing. If the file has an error, the relay keeps its running configuration: exit code 1.",
    )
    parser.add_argument("--url", metavar="URL", help="which relay, if there are several: its host:port or URL")
    return parser


def healthcheck() -> Parser:
    """Return the parser of `syncrelay healthcheck`."""
    from syncrelay.cli.heartbeat import VARIABLE

    return Parser(
        "syncrelay healthcheck",
        example=f"{VARIABLE}=/run/syncrelay/heartbeat syncrelay healthcheck",
        description=f"Checks that the relay is receiving: the relay writes a heartbeat into the file that {VARIABLE} "
        "names. Exit code 1 if it is not receiving.",
    )


def schema() -> Parser:
    """Return the parser of `syncrelay schema`."""
    parser = Parser(
        "syncrelay schema",
        example="syncrelay schema > syncrelay.json",
        description="Prints the JSON Schema (draft 7) of the file: with it, editors complete and check what you write.",
    )
    parser.add_argument("--test", action="store_true", help="print that of test files, see syncrelay test")
    return parser


def completion() -> Parser:
    """Return the parser of `syncrelay completion`."""
    parser = Parser(
        "syncrelay completion",
        example="syncrelay completion fish > ~/.config/fish/completions/syncrelay.fish",
        description="Prints a script that makes a shell complete syncrelay's commands, options and files, the groups "
        "of a file and the topics of a recording.",
        epilog="where to put it:\n"
        "  bash  ~/.local/share/bash-completion/completions/syncrelay\n"
        "  zsh   _syncrelay in a folder of $fpath, before compinit\n"
        "  fish  ~/.config/fish/completions/syncrelay.fish\n",
    )
    parser.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")
    return parser
