"""TAB: what shells are told, and the three shells on terminals of their own."""

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from syncrelay.cli import completion
from syncrelay.cli import run as relay
from syncrelay.cli.commands import COMMANDS
from syncrelay.cli.completion import COMPLETERS
from syncrelay.yaml_files import group_names
from tests.cli.command import ROOT, run, run_python
from tests.cli.terminals import on_terminal
from tests.recordings.bag.making import rig, write_mcap, write_rosbag2

_FILE = """\
version: 1
groups:
  front: {policy: exact_time, topics: []}
  rear: {policy: exact_time, topics: []}
"""
# What a word of the line may be that no completion knows: a number, a place, a sentence.
_UNKNOWN = {"N", "URL", "FAULT", "GROUP", "TOPIC", "TOPIC:FIELD,...", "PATTERN", "TIME"}


# One process for many lines; all that argcomplete is told by a shell but where to write.
_ANSWERS = """
import json, os, sys
from syncrelay.cli.completion import complete
os.environ.update(_ARGCOMPLETE_IFS="\\n", _ARGCOMPLETE_SHELL="fish", _ARGCOMPLETE_SUPPRESS_SPACE="1")
os.environ["_ARGCOMPLETE_STDOUT_FILENAME"] = answer = ".answer"
def completed(line):
    open(answer, "w").close()
    os.environ.update(COMP_LINE=line, COMP_POINT=str(len(line)), _ARGCOMPLETE="1")
    assert complete() == 0
    return open(answer).read().splitlines()
print(json.dumps([completed(line) for line in sys.argv[1:]]))
imported = [name for name in ("rclpy", "pydantic", "numpy", "rosbags") if name in sys.modules]
print(*imported, file=sys.stderr)
"""


def completed(*lines, folder):
    """What a shell is told for each line with the cursor at its end; and what was imported that is slow."""
    done = run_python("-c", _ANSWERS, *lines, folder=folder)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), done.stderr.split()


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "fusion.yaml").write_text(_FILE)
    (tmp_path / "notes.txt").write_text("")
    (tmp_path / "maps").mkdir()
    (tmp_path / "conf").mkdir()
    for name in ("left", "right"):
        (tmp_path / "conf" / f"{name}.yaml").write_text(_FILE.replace("front", name).replace("  rear", "  # "))
    return tmp_path


_LINES = {
    "syncrelay val": ["validate"],
    "syncrelay re": ["replay", "reload"],
    "syncrelay --wa": ["--watch"],
    "syncrelay --config ": ["conf/", "fusion.yaml", "maps/"],
    "syncrelay --config=f": ["--config=fusion.yaml"],
    "syncrelay --config fusion.yaml --group ": ["front", "rear"],
    "syncrelay --config fusion.yaml --group rear --group f": ["front"],
    "syncrelay --config missing.yaml --group ": [],
    "syncrelay --config maps --group ": [],
    "syncrelay --config conf --group ": ["left", "right"],
    "syncrelay --config fusion.yaml --config conf/ --group r": ["rear", "right"],
    "syncrelay --config fusion.yaml --log-level ": ["debug", "info", "warning", "error"],
    "syncrelay --config fusion.yaml --ros-args ": [],
    "syncrelay observe --config fusion.yaml --group ": ["front", "rear"],
    "syncrelay observe --seconds ": [],
    "syncrelay validate ": ["conf/", "fusion.yaml", "maps/"],
    "syncrelay diff ": ["conf/", "fusion.yaml", "maps/"],
    "syncrelay diff fusion.yaml f": ["fusion.yaml"],
    "syncrelay graph fusion.yaml --format ": ["mermaid", "text"],
    "syncrelay validate fusion.yaml --fo": ["--format"],
    "syncrelay test ": ["conf/", "fusion.yaml", "maps/"],
    "syncrelay test fusion.yaml --format ": ["text", "junit", "json", "github"],
    "syncrelay doctor --config fusion.yaml --l": ["--live"],
    "syncrelay init --from-bag maps --from": [],
    "syncrelay completion ": ["bash", "zsh", "fish"],
    "cd maps && SOME=1 syncrelay sche": ["schema"],
    "/opt/bin/syncrelay sche": ["schema"],
    "syncrelay nonsense --l": ["--log-level", "--log-format"],
}


def test_a_line_is_completed_by_what_may_follow_without_ros_and_the_models(folder):
    answers, imported = completed(*_LINES, folder=folder)
    assert dict(zip(_LINES, answers, strict=True)) == _LINES
    assert imported == []


def test_the_first_word_is_a_command_or_an_option_of_the_relay(folder):
    ((words,), _) = completed("syncrelay ", folder=folder)
    assert {*COMMANDS, "--config", "--version", "--help"} <= set(words)


def test_topics_are_those_of_the_recording_that_are_not_named_yet(folder):
    write_mcap(folder / "rig.mcap", rig(3))
    write_rosbag2(folder / "drive", rig(3))
    answers, _ = completed(
        "syncrelay analyze ",
        "syncrelay analyze rig.mcap ",
        "syncrelay analyze drive /camera /",
        "syncrelay analyze rig.mcap d",
        "syncrelay analyze notes.txt ",
        folder=folder,
    )
    recordings = ["conf/", "drive/", "maps/", "rig.mcap"]
    assert answers == [recordings, ["/camera", "/lidar"], ["/lidar"], ["drive/"], recordings]


def test_nobody_waits_for_a_pipe(folder):
    os.mkfifo(folder / "pipe.yaml")
    assert completed("syncrelay --config pipe.yaml --group ", folder=folder)[0] == [[]]


def test_a_name_that_a_terminal_must_not_see_is_not_offered(folder):
    (folder / "fusion.yaml").write_text('groups: {front: {}, "\\e[2Jgone": {}, "a\\nb": {}}\n')
    (folder / "x\x1b[2J.yaml").write_text("")
    answers, _ = completed("syncrelay --config fusion.yaml --group ", "syncrelay --config x", folder=folder)
    assert answers == [["front"], []]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        (_FILE, ["front", "rear"]),
        ("groups:\n  front: {topics: [{topic: /a}]}\n  rear: {topics: ]\n  left: {}\n", []),
        ("groups: {front: &f {a: [1, 2]}, rear: *f}", ["front", "rear"]),
        ("defaults: {groups: {none: 1}}\ngroups: {? [1] : 2, front: 1}", ["front"]),
        ("shared: &s {}\ngroups: {<<: *s, front: {<<: *s}}", ["front"]),
        ("groups: [front, rear]", []),
        ("- groups: {front: 1}", []),
        ("\tgroups: {front: 1}", []),
        ("", []),
    ],
)
def test_the_groups_of_a_file_are_the_keys_below_groups_where_it_is_valid(text, names):
    assert list(group_names(text.encode())) == names


def test_bytes_that_are_no_text_have_no_groups():
    assert list(group_names(b"groups: {\xff\xfe: 1}")) == []


def test_every_word_that_a_command_takes_is_known_to_completion():
    taken = {
        action.metavar
        for parser in (relay.parser, *(command.parser for command in COMMANDS.values()))
        for action in parser().actions
        if action.choices is None and action.nargs != 0
    }
    assert taken - _UNKNOWN == set(COMPLETERS) - {"COMMAND"}


@pytest.fixture
def environ(folder):
    """An environment in which `syncrelay` is the one that is tested, and a script for each shell is in the folder."""
    program = folder / "bin" / "syncrelay"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} -m syncrelay "$@"\n')
    program.chmod(0o755)
    for shell in ("bash", "zsh", "fish"):
        (folder / f"complete.{shell}").write_text(run("completion", shell, folder=folder).stdout)
    return {
        "PATH": f"{program.parent}:{os.environ['PATH']}",
        "PYTHONPATH": os.environ.get("PYTHONPATH", str(ROOT)),
        "HOME": str(folder),
        "TERM": "dumb",
        "PS1": "> ",
        "LC_ALL": "C.UTF-8",
    }


def require(shell):
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed (apt-get install {shell})")


_STARTS = {
    "bash": (["bash", "--norc", "--noprofile", "-i"], "source ./complete.bash"),
    "zsh": (["zsh", "-f", "-i"], "autoload -U compinit; compinit -u -D; source ./complete.zsh"),
}


@pytest.mark.parametrize("shell", _STARTS)
def test_tab_completes_in_a_terminal(shell, folder, environ):
    require(shell)
    argv, start = _STARTS[shell]
    write_mcap(folder / "rig.mcap", rig(3))
    with on_terminal(argv, folder=folder, environ=environ) as terminal:
        terminal.type(f"{start}; echo re''ady\n", until="ready")
        for begun, whole in (
            ("syncrelay val", "syncrelay validate "),
            ("syncrelay --config fu", "syncrelay --config fusion.yaml "),
            ("syncrelay --config fusion.yaml --group r", "--group rear "),
            ("syncrelay analyze rig.mcap /li", "rig.mcap /lidar "),
        ):
            terminal.type(f"{begun}\t", until=whole)
            terminal.type("\x15echo next''line\n", until="nextline")


def test_fish_is_told_what_may_follow_and_why(folder, environ):
    require("fish")
    lines = ("syncrelay val", "syncrelay --config fu", "syncrelay --config fusion.yaml --group ")
    script = "; ".join(["source complete.fish", *(f"complete -C '{line}'" for line in lines)])
    done = subprocess.run(
        [shutil.which("fish") or "", "--no-config", "-c", script],
        cwd=folder,
        env=environ,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [f"validate\t{COMMANDS['validate'].does}", "fusion.yaml", "front", "rear"]


def test_the_places_that_the_help_names_are_those_of_the_page_on_installing():
    page = (Path(ROOT) / "docs/howto/install.md").read_text()
    places = [line for line in (completion.parser().epilog or "").splitlines() if line.startswith("  ")]
    assert len(places) == 3
    for line in places:
        assert line.split()[1] in page
