"""Follows a page of docs/: writes its files, runs its console blocks in order, and compares the output that it shows.

A block that cannot be run, or a text that is not its output, has a comment before it: `<!-- not run: REASON -->`.
"""

import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from tests import preloaded
from tests.cli.command import run_here
from tests.cli.terminals import on_terminal
from tests.ros.processes import Process, ros_environment, wait_until

_BLOCK: Final = re.compile(
    r"(?:^<!-- not run: (?P<reason>.+) -->\n+)?^```(?P<kind>\w+)\n(?P<text>.*?)^```", re.MULTILINE | re.DOTALL
)
_WRITTEN: Final = re.compile(r"\b[Ww]rite `([\w./]+\.yaml)`:$")
_INTO_THE_FILE: Final = re.compile(r"\bwrite .* into the file, while the relay runs:$")
# Options whose value is a file that must not exist yet.
_WRITES: Final = ("-o", "--output", "--write", "--record")
# Commands that exit with 1 if they found something.
_MAY_FIND: Final = ("diff", "doctor", "observe", "test")
# Not run here: tests/test_pages.py checks what pages install.
_INSTALLS: Final = ("pip",)
# Words of commands that need nodes or a running relay; a command of `--config` alone is the relay itself.
_LIVE: Final = frozenset(
    ("--live", "--from-graph", "--url", "observe", "top", "tap", "reload", "--watch", "--ros-args")
)
# Commands that start no thread or process and set up no log.
_NEEDS_NO_PROCESS: Final = ("analyze", "diff", "graph", "init", "replay", "schema", "test", "validate")
_UNITS: Final = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}
_NUMBER: Final = re.compile(r"(:?)(?<![\w.])[-+]?(\d+(?:\.\d+)?)(?: ?(ns|us|ms|s|min|Hz|%|[kM]?B)\b)?")
# The largest factor between a shown and a measured figure.
_LIKE: Final = 2.0
_DEADLINE_S: Final = 90.0


class Block(NamedTuple):
    """A block of a page: its kind, its text, the line of prose before it, and why it is not run, if so."""

    kind: str
    text: str
    before: str
    reason: str | None
    section: int


def blocks_of(page: str) -> list[Block]:
    """Return the blocks of a page's text in order."""
    found = []
    end = section = 0
    for block in _BLOCK.finditer(page):
        prose = page[end : block.start()]
        section += len(re.findall(r"^#", prose, re.MULTILINE))
        end = block.end()
        before = prose.strip().rpartition("\n\n")[2]
        found.append(Block(block["kind"], block["text"], before, block["reason"], section))
    return found


def commands_of(block: Block) -> list[str]:
    """Return the commands of a console block."""
    lines = block.text.splitlines()
    assert all(line.startswith("$ ") for line in lines), f"not a command: {block.text}"
    return [line.removeprefix("$ ") for line in lines]


def is_like(shown: str, found: str) -> bool:
    """Whether a line is the shown one, except for measured figures.

    A figure with a unit may differ by the factor _LIKE, one after a colon, such as a port, must be equal, and a count
    may be anything. A shown line that ends in `...` may go on in any way.
    """
    start = shown.removesuffix("...").rstrip()
    pattern, text = (_NUMBER.sub("#", line) for line in (start, found))
    pairs = zip(_NUMBER.findall(start), _NUMBER.findall(found), strict=False)
    is_same = text.startswith(pattern) if start != shown else text == pattern
    return is_same and all(_is_about(one, other) for one, other in pairs)


def _is_about(one: tuple[str, str, str], other: tuple[str, str, str]) -> bool:
    (colon, number, unit), (_, other_number, other_unit) = one, other
    if colon:
        return number == other_number
    if not unit or not other_unit:
        return unit == other_unit
    sizes = [float(value) * _UNITS.get(each, 1.0) for value, each in ((number, unit), (other_number, other_unit))]
    # Small durations and percentages vary by more.
    return max(sizes) <= _LIKE * min(sizes) or unit == "%" or max(sizes) < _UNITS["ms"]


@dataclass
class Reader:
    """Follows pages, in a folder.

    `inside` are words that, put before a command, run it in a network of its own. With `may_replace`, files that are
    there are removed before a command that writes them: the blocks of a how-to page are alternatives.
    """

    folder: Path
    domain: int
    may_replace: bool
    inside: Sequence[str] = ()
    ran: set[str] = field(default_factory=set)
    _said: list[str] = field(default_factory=list)
    _open: list[Process] = field(default_factory=list)
    _file: str = ""
    _look_again: str | None = None

    def read(self, page: str, takes: Callable[[Block], bool] = lambda _: True, *, first: Sequence[str] = ()) -> None:
        """Follow a page. Of its console blocks, run those that `takes` accepts; run the commands `first` before all."""
        section = -1
        with ExitStack() as stack:
            stack.callback(self._close)
            for command in first:
                self.do(command, stack)
            for block in blocks_of(page):
                if block.reason is not None:
                    continue
                if block.kind == "yaml":
                    self._write(block)
                elif block.kind == "console":
                    section = block.section if takes(block) else -1
                    for command in commands_of(block) if takes(block) else ():
                        self.do(command, stack)
                elif block.kind == "text" and block.section == section:
                    self._compare(block, stack)

    @property
    def _environment(self) -> Mapping[str, str]:
        return ros_environment(domain=self.domain, folder=self.folder)

    def _write(self, block: Block) -> None:
        if (named := _WRITTEN.search(block.before)) is not None:
            self._file = named[1]
        elif not _INTO_THE_FILE.search(block.before):
            return
        (self.folder / self._file).parent.mkdir(parents=True, exist_ok=True)
        (self.folder / self._file).write_text(block.text)

    def do(self, command: str, stack: ExitStack) -> None:
        """Run a command to its end; if it is one that stays, until it runs."""
        line, _, target = command.partition(" > ")
        program, *words = self._expanded(line)
        if program in _INSTALLS:
            return
        assert program == "syncrelay", f"nobody knows how to run {command}"
        self.ran.add(command)
        for option, value in pairwise(words):
            if self.may_replace and option in _WRITES:
                (self.folder / value).unlink(missing_ok=True)
        inside = [*self.inside, f"--wd={self.folder}"] if self.inside else []
        argv = [*inside, sys.executable, "-m", "syncrelay", *words]
        if _is_screen(words):
            self._look(argv, command, stack)
        elif _stays(words):
            self._start(argv, command)
        else:
            if words[0] in _NEEDS_NO_PROCESS and not self.inside:
                done = run_here(*words, folder=self.folder, environ=self._environment)
            else:
                done = preloaded.run(argv, environ=self._environment, folder=self.folder)
            allowed = (0, 1) if words[0] in _MAY_FIND else (0,)
            assert done.returncode in allowed, f"{command}: exit code {done.returncode}\n{done.stdout}{done.stderr}"
            assert "Traceback" not in done.stderr, done.stderr
            if target:
                (self.folder / target).write_text(done.stdout)
            self._said += _spoken(done.stdout + done.stderr)
            self._look_again = command if "--once" in words else None

    def _expanded(self, line: str) -> list[str]:
        """Return the words of a command line after the shell's expansion."""
        script = f"printf '%s\\0' {line}"
        shell = subprocess.run(["/bin/bash", "-c", script], cwd=self.folder, capture_output=True, text=True, check=True)
        return shell.stdout.split("\0")[:-1]

    def _start(self, argv: Sequence[str], command: str) -> None:
        """Start a command that stays, and wait until it says that it runs."""
        process = Process(f"said-{len(self._open)}", argv, environment=self._environment, folder=self.folder)
        self._open.append(process)
        words = shlex.split(command)
        if "demo" in words:
            process.wait_until(lambda: "sets a second" in process.stdout, f"sets of `{command}`")
        elif "tap" not in words:
            process.wait_for_log(" running: ")
        elif "--reason" in words:
            # It prints nothing while the relay is healthy.
            process.wait_until(lambda: _has_socket(process.pid), f"the connection of `{command}`")
        else:
            process.wait_until(lambda: process.stdout, f"lines of `{command}`")

    def _look(self, argv: Sequence[str], command: str, stack: ExitStack) -> None:
        """Look at a screen until it shows a group, and end it by Ctrl-C."""
        terminal = stack.enter_context(on_terminal(argv, folder=self.folder, environ=self._environment))
        # The groups of a file that `init` proposed have other names.
        terminal.wait_for("/demo/" if "robot.yaml" in argv else "front")
        terminal.press("\x03")
        assert terminal.wait_for_end() in (0, 1, 130), f"{command}: {terminal.written[-2000:]}"

    def _compare(self, block: Block, stack: ExitStack) -> None:
        """Wait until all lines of a block were printed; where no process runs, they must be equal word for word."""
        if "Ctrl-C ends the relay" in block.before:
            self._end(self._open[-1])
        lines = block.text.splitlines()

        def missing() -> list[str]:
            said = [*self._said, *(line for each in self._open for line in _lines(each))]
            return [line for line in lines if line not in said and not (self._open and _among(line, said))]

        def have_come() -> bool:
            if missing() and self._look_again is not None:
                self.do(self._look_again, stack)
            return not missing()

        with suppress(AssertionError):
            wait_until(have_come, "", deadline_s=_DEADLINE_S if self._open else 0, poll_s=1)
        found = [*self._said[-40:], *(line for each in self._open for line in _lines(each)[-40:])]
        lacking = missing()
        assert not lacking, "\n".join(["the page shows what did not come:", *lacking, "what came:", *found])

    def _end(self, process: Process) -> None:
        process.send(signal.SIGINT)
        code = process.wait()
        assert code in (0, 130), f"exit code {code}: {process.stderr}"

    def _close(self) -> None:
        for process in reversed(self._open):
            if process.running():
                self._end(process)


def _has_socket(pid: int) -> bool:
    with suppress(FileNotFoundError, ProcessLookupError):
        return any(each.readlink().name.startswith("socket:") for each in Path(f"/proc/{pid}/fd").iterdir())
    return False


def _lines(process: Process) -> list[str]:
    return _spoken(process.stdout + process.stderr)


def _spoken(text: str) -> list[str]:
    """Return the lines as they are, and without the prefix of a log entry or a remark."""
    lines = text.splitlines()
    return [*lines, *(re.sub(r"^(\[.*?\]: |syncrelay: )", "", line) for line in lines)]


def _among(line: str, said: Sequence[str]) -> bool:
    return any(is_like(line, each) for each in said)


def _is_screen(words: Sequence[str]) -> bool:
    return (words[0] == "top" and "--once" not in words) or (words[0] == "observe" and "--seconds" not in words)


def _stays(words: Sequence[str]) -> bool:
    return words[0] in ("--config", "tap") or (words[0] == "demo" and not {"--record", "--show-config"} & {*words})


def is_live(block: Block) -> bool:
    """Whether a console block needs nodes, or a relay."""
    return any(_LIVE & {*command.split()} for command in commands_of(block))
