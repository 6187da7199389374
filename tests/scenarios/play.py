"""Plays scenarios over DDS: one relay, one source, a group for each, in three acts; and what the relay said of each.

An act lasts until what it is for has come.
"""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tests.ros.domain import claimed_domain
from tests.ros.processes import Process
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage, running_stage
from tests.ros.status import status
from tests.scenarios.rigs import Scenario, cure_in, group_of, placed, write
from tests.scenarios.streams import as_json

# Long enough to know how fast an input comes, and for a warning of what is not so to be logged.
ACT_S = 14.0
# A bound for broken runs, not a measure.
_DEADLINE_S = 60.0
_POLL_S = 0.4
_MOST_PLAYS = 3
BUSY = {"too_slow"}
"""What a machine that gives a relay too little time makes of it, truly: no test has a say in that."""


class Line(NamedTuple):
    """A line of the log that is about a group."""

    act: str
    group: str
    finding: str
    level: str
    message: str

    @property
    def warns(self) -> bool:
        return self.level not in ("info", "debug")


class Played(NamedTuple):
    """What a relay said of its groups."""

    lines: list[Line]
    shown: dict[str, dict[str, dict[str, Any]]]
    """The findings that /status showed in each act, by group and code, as they were first."""
    last: dict[str, Any]
    """What /status showed at last, by group."""
    written: dict[str, dict[str, str]]
    """What was written into the file of a group, as the relay suggested it."""
    disturbed: str
    """What shows that the machine did not give the play its time; empty where nothing does."""

    def warnings_of(self, group: str) -> list[Line]:
        return [line for line in self.lines if line.group == group and line.warns]

    def false_warnings(self, group: str, allowed: Collection[str]) -> list[Line]:
        return [line for line in self.warnings_of(group) if line.finding not in BUSY | set(allowed)]

    def problems_at_last(self, group: str) -> set[str]:
        return {each["code"] for each in self.last[group]["findings"] if each["severity"] != "ok"}

    def told(self, group: str) -> str:
        """All that was said of a group, in lines."""
        said = [f"act {line.act}: [{line.finding}] {line.message}" for line in self.warnings_of(group)]
        shown = [f"act {act}: /status showed {', '.join(found)}" for act, found in self.shown.get(group, {}).items()]
        last = [f"at last: [{each['code']}] {each['text']}" for each in self.last.get(group, {}).get("findings", [])]
        return "\n".join([group, *said, *shown, *last, f"written: {self.written.get(group)}"])


class Theatre:
    """A relay of some scenarios, in a file that can be written anew, their source in act 1, and a watch over both."""

    def __init__(self, stage: Stage, scenarios: Mapping[str, Scenario]) -> None:
        self.groups = {name: group_of(name, scenario) for name, scenario in scenarios.items()}
        table = stage.folder / "streams.json"
        table.write_text(as_json([each for name, rig in scenarios.items() for each in placed(name, rig.streams)]))
        argv = [sys.executable, "-m", "tests.scenarios.source", str(table)]
        self.source = stage.start("source", argv, stdin=subprocess.PIPE)
        self.source.tell("1")
        self.file = ReloadedFile(stage, "--log-format", "json", **self.groups)
        self.watch = Watch(self.file.relay, self.source)

    def begin(self, act: str) -> None:
        self.watch.begin(act)
        self.source.tell(act)


class Watch:
    """Reads a relay's log and state, act by act."""

    def __init__(self, relay: Process, source: Process) -> None:
        self._relay, self._source = relay, source
        self._act = "1"
        self._read = 0
        self._lines: list[Line] = []
        self._shown: dict[str, dict[str, dict[str, Any]]] = {}
        self._last: dict[str, Any] = {}

    def begin(self, act: str) -> None:
        self._look()
        self._act = act

    def _read_log(self) -> None:
        *said, _ = self._relay.stderr.split("\n")
        for text in said[self._read :]:
            line = json.loads(text) if text.startswith("{") else {}
            # What hits several groups is one line.
            for group in line.get("groups", [line["group"]] if "group" in line else []):
                self._lines.append(Line(self._act, group, line.get("finding", ""), line["level"], line["message"]))
        self._read = len(said)

    def _look(self) -> None:
        """Read on what there is."""
        self._read_log()
        self._last = {each["name"]: each for each in status(self._relay)["groups"]}
        for name, group in self._last.items():
            shown = self._shown.setdefault(name, {}).setdefault(self._act, {})
            for finding in group["findings"]:
                shown.setdefault(finding["code"], finding)

    def wait(self, condition: Callable[[], bool], *, least_s: float = ACT_S) -> None:
        """Look on until the condition holds, or will not hold any more: what is missing then, a test tells."""
        began = time.monotonic()
        while (passed := time.monotonic() - began) < least_s + _DEADLINE_S:
            assert self._relay.running(), self._relay.stderr
            assert self._source.running(), self._source.stderr
            self._look()
            if passed >= least_s and condition():
                return
            time.sleep(_POLL_S)

    def has_warned_of(self, name: str, finding: str) -> bool:
        return any((line.group, line.finding) == (name, finding) and line.warns for line in self._lines)

    def are_well(self, names: Collection[str]) -> bool:
        shown = (self._last.get(name, {"findings": []})["findings"] for name in names)
        return all(any(finding["code"] == "healthy" for finding in findings) for findings in shown)

    def suggested(self, name: str, scenario: Scenario) -> dict[str, str]:
        """What the first warning of the cause suggests: the keys of the scenario's cure."""
        texts = (line.message for line in self._lines if (line.group, line.finding) == (name, scenario.first))
        found = (shown[scenario.first] for shown in self._shown[name].values() if scenario.first in shown)
        return cure_in(next(texts, ""), next(found, {"topic": None})["topic"] or "", scenario)

    def played(self, written: dict[str, dict[str, str]] | None = None) -> Played:
        """All that was seen, of a relay that may have ended."""
        self._read_log()
        return Played(self._lines, self._shown, self._last, written or {}, self._source.stdout)


def play(stage: Stage, scenarios: Mapping[str, Scenario]) -> Played:
    """Play scenarios to their end."""
    theatre = Theatre(stage, scenarios)
    watch = theatre.watch
    watch.wait(lambda: watch.are_well([name for name, each in scenarios.items() if each.begins_well]))
    theatre.begin("2")
    watch.wait(lambda: all(watch.has_warned_of(name, each.first) for name, each in scenarios.items() if each.first))
    written = {name: watch.suggested(name, each) for name, each in scenarios.items() if each.cure}
    for name, changes in written.items():
        write(theatre.groups[name], changes)
    theatre.begin("3")
    theatre.file.reload(**theatre.groups)
    watch.wait(lambda: watch.are_well([name for name, each in scenarios.items() if each.heals]))
    # Its last words are of the groups, too.
    theatre.file.relay.send(signal.SIGTERM)
    theatre.file.relay.wait()
    played = watch.played(written)
    # Where nothing that is played keeps the relay from running, what it says of that is so.
    busy = [name for name, acts in played.shown.items() if any(BUSY & found.keys() for found in acts.values())]
    return played._replace(disturbed=f"{played.disturbed}{busy or ''}")


def undisturbed(tmp_path: Path, play: Callable[[Stage], Played], faults: Callable[[Played], Iterator[str]]) -> None:
    """Hold that a play has no faults. One that the machine disturbed proves nothing: then it is played again."""
    starved = []
    for number in range(_MOST_PLAYS):
        folder = tmp_path / str(number)
        folder.mkdir()
        with claimed_domain() as domain, running_stage(folder, domain) as stage:
            played = play(stage)
        found = list(faults(played))
        if not found:
            return
        starved.append(any(line.warns and line.finding in BUSY for line in played.lines))
        if not played.disturbed:
            break
    if len(starved) == _MOST_PLAYS and all(starved):
        pytest.skip(f"the machine starved all plays: {played.disturbed}")
    raise AssertionError("\n\n".join([*found, f"disturbed: {played.disturbed or 'not at all'}"]))
