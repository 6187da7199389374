"""Plays scenarios: one relay, one source, a group for each, in three acts; and what the relay said of each.

In act 1 a rig is as it should be where its scenario begins so, in act 2 it is broken, in act 3 it is mended: by the
source, or by what the relay has suggested, written into its file. An act lasts until what it is for has come.
"""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from tests.ros.cdr_messages import VECTOR
from tests.ros.processes import Process
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import Stage
from tests.ros.status import status
from tests.scenarios.streams import Stream, as_json

# Long enough to know how fast an input comes, and for a warning of what is not so to be logged.
ACT_S = 14.0
# A bound for broken runs, not a measure.
_DEADLINE_S = 60.0
_POLL_S = 0.4
_KEY = re.compile(r"`(?P<key>\w+): (?P<value>[^`]+)`(?: at (?P<topic>/[\w/]+))?")
_OF_INPUTS = {"offset", "stamp", "qos", "type", "topic"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """One group, its sensors, and what the relay is to say of it."""

    streams: Sequence[Stream]
    """Their topics are those of the group, below a namespace of its name."""
    options: Mapping[str, Any] = field(default_factory=dict)
    inputs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """More keys of an input, by its topic."""
    listens_to: Sequence[str] = ()
    """The topics that the group has in its file, where they are not those of the streams."""
    first: str = ""
    """The code of the first warning, that names the cause; empty where there is none to be."""
    says: str = ""
    """What this warning says, as a pattern."""
    also: frozenset[str] = frozenset()
    """What may be said beside it."""
    never_says: str = ""
    """What no warning may say, as a pattern."""
    cure: Sequence[str] = ()
    """The keys of the suggestion that are written into the file for act 3."""
    heals: bool = True
    """Whether all is well in act 3."""
    over: str = ""
    """What is noted when it is over, as a pattern; empty where that does not matter."""

    @property
    def begins_well(self) -> bool:
        return any(("1" in stream.acts) != ("2" in stream.acts) for stream in self.streams)


class Line(NamedTuple):
    """A warning or more of the log that is about a group."""

    act: str
    group: str
    finding: str
    message: str


class Played(NamedTuple):
    """What a relay said of its groups."""

    warnings: list[Line]
    notes: list[Line]
    """Lines of the log that are no warnings."""
    shown: dict[str, dict[str, list[str]]]
    """The codes that /status showed in each act, by group."""
    last: dict[str, Any]
    """What /status showed at last, by group."""
    written: dict[str, dict[str, str]]
    """What was written into the file of a group, as the relay suggested it."""
    disturbed: str
    """What shows that the machine did not give the play its time; empty where nothing does."""
    starved: bool
    """Whether it was for so long that the relay warned of it."""

    @classmethod
    def from_json(cls, text: str) -> "Played":
        warnings, notes, *rest = json.loads(text)
        return cls([Line(*line) for line in warnings], [Line(*line) for line in notes], *rest)

    def warnings_of(self, group: str) -> list[Line]:
        return [line for line in self.warnings if line.group == group]

    def notes_of(self, group: str) -> list[Line]:
        return [line for line in self.notes if line.group == group]

    def as_json(self) -> str:
        return json.dumps(self)


def group_of(name: str, scenario: Scenario) -> dict[str, Any]:
    """The group of the relay's file."""
    topics = scenario.listens_to or list(dict.fromkeys(stream.topic for stream in scenario.streams))
    rows = [{"topic": f"/{name}/{topic}", "type": VECTOR, **scenario.inputs.get(topic, {})} for topic in topics]
    policy = {} if "policy" in scenario.options else {"policy": "approximate_time", "slop": "20ms"}
    return {**policy, **scenario.options, "topics": rows}


class Source:
    """The process that plays the streams."""

    def __init__(self, stage: Stage, streams: Sequence[Stream]) -> None:
        table = stage.folder / f"streams-{time.monotonic_ns()}.json"
        table.write_text(as_json(streams))
        argv = [sys.executable, "-m", "tests.scenarios.source", str(table)]
        self.process = stage.start("source", argv, stdin=subprocess.PIPE)

    def begin(self, act: str) -> None:
        self.process.tell(act)


class Watch:
    """Reads a relay's log and state, act by act."""

    def __init__(self, relay: Process, source: Process) -> None:
        self._relay, self._source = relay, source
        self._act = "1"
        self._read = 0
        self.lines: list[tuple[str, Line]] = []
        self.shown: dict[str, dict[str, set[str]]] = {}
        self.last: dict[str, Any] = {}
        self._topics: dict[tuple[str, str], str] = {}

    def begin(self, act: str) -> None:
        self.look()
        self._act = act

    def read_log(self) -> None:
        *said, _ = self._relay.stderr.split("\n")
        for text in said[self._read :]:
            line = json.loads(text) if text.startswith("{") else {}
            # What hits several groups is one line.
            for group in line.get("groups", [line["group"]] if "group" in line else []):
                about = Line(self._act, group, line.get("finding", ""), line["message"])
                self.lines.append((line["level"], about))
        self._read = len(said)

    def look(self) -> None:
        """Read on what there is."""
        self.read_log()
        self.last = {each["name"]: each for each in status(self._relay)["groups"]}
        for name, group in self.last.items():
            codes = self.shown.setdefault(name, {}).setdefault(self._act, set())
            codes |= {finding["code"] for finding in group["findings"]}
            for finding in group["findings"]:
                self._topics.setdefault((name, finding["code"]), finding["topic"] or "")

    def suggested(self, name: str, scenario: Scenario) -> dict[str, str]:
        """What the first warning of the cause suggests: the keys of the scenario's cure, behind their input's topic."""
        texts = (line.message for _, line in self.lines if (line.group, line.finding) == (name, scenario.first))
        return offered(next(texts, ""), self._topics.get((name, scenario.first), ""), scenario.cure)

    def wait(self, condition: Callable[[], bool], *, least_s: float = ACT_S) -> None:
        """Look on until the condition holds, or will not hold any more: what is missing then, a test tells."""
        began = time.monotonic()
        while (passed := time.monotonic() - began) < least_s + _DEADLINE_S:
            assert self._relay.running(), self._relay.stderr
            assert self._source.running(), self._source.stderr
            self.look()
            if passed >= least_s and condition():
                return
            time.sleep(_POLL_S)

    def has_warned_of(self, name: str, finding: str) -> bool:
        return any((line.group, line.finding) == (name, finding) and level != "info" for level, line in self.lines)

    def has_noted(self, name: str, pattern: str) -> bool:
        """Whether a note of the group matches a pattern somewhere; the empty one needs none."""
        return not pattern or any(
            line.group == name and level == "info" and re.search(pattern, line.message) for level, line in self.lines
        )

    def is_well(self, name: str) -> bool:
        return any(finding["code"] == "healthy" for finding in self.last.get(name, {"findings": []})["findings"])

    def played(self, written: dict[str, dict[str, str]] | None = None) -> Played:
        """All that was seen, of a relay that may have ended."""
        self.read_log()
        shown = {name: {act: sorted(codes) for act, codes in acts.items()} for name, acts in self.shown.items()}
        warnings = [line for level, line in self.lines if level not in ("info", "debug")]
        notes = [line for level, line in self.lines if level == "info"]
        return Played(warnings, notes, shown, self.last, written or {}, self._source.stdout, starved=False)


def _with_what_the_relay_says_of_the_machine(played: Played) -> Played:
    """Where nothing that is played keeps the relay from running, what it says of that is so."""
    warned = [line.message for line in played.warnings if line.finding == "too_slow"]
    shown = [name for name, acts in played.shown.items() if "too_slow" in set().union(*acts.values())]
    disturbed = "\n".join([played.disturbed, *warned, *(f"{name}: too slow" for name in shown)])
    return played._replace(disturbed=disturbed.strip(), starved=bool(warned))


def placed(name: str, streams: Sequence[Stream]) -> list[Stream]:
    """The streams below the namespace of their group, each with a driver there."""
    return [
        replace(
            stream,
            topic=stream.topic if stream.topic.startswith("/") else f"/{name}/{stream.topic}",
            node=f"/{name}/{stream.driver}",
        )
        for stream in streams
    ]


class Theatre:
    """A relay of some scenarios, in a file that can be written anew, their source in act 1, and the watch over both."""

    def __init__(self, stage: Stage, scenarios: Mapping[str, Scenario]) -> None:
        self.groups = {name: group_of(name, scenario) for name, scenario in scenarios.items()}
        self.source = Source(stage, [each for name, rig in scenarios.items() for each in placed(name, rig.streams)])
        self.source.begin("1")
        self.file = ReloadedFile(stage, "--log-format", "json", **self.groups)
        self.watch = Watch(self.file.relay, self.source.process)

    def begin(self, act: str) -> None:
        self.watch.begin(act)
        self.source.begin(act)


def play(stage: Stage, scenarios: Mapping[str, Scenario]) -> Played:
    """Play scenarios to their end."""
    theatre = Theatre(stage, scenarios)
    watch = theatre.watch
    watch.wait(lambda: all(watch.is_well(name) for name, each in scenarios.items() if each.begins_well))
    theatre.begin("2")
    watch.wait(lambda: all(watch.has_warned_of(name, each.first) for name, each in scenarios.items() if each.first))
    written = {name: watch.suggested(name, each) for name, each in scenarios.items() if each.cure}
    for name, changes in written.items():
        write(theatre.groups[name], changes)
    theatre.begin("3")
    theatre.file.reload(**theatre.groups)
    watch.wait(
        lambda: all(
            watch.is_well(name) and watch.has_noted(name, each.over) for name, each in scenarios.items() if each.heals
        )
    )
    # Its last words are of the groups, too.
    theatre.file.relay.send(signal.SIGTERM)
    theatre.file.relay.wait()
    return _with_what_the_relay_says_of_the_machine(watch.played(written))


def offered(text: str, about: str, cure: Sequence[str]) -> dict[str, str]:
    """The keys of a cure and their values in a warning about a topic; those of an input behind their topic."""
    found: dict[str, str] = {}
    for offer in _KEY.finditer(text):
        topic = (offer["topic"] or about) if offer["key"] in _OF_INPUTS else ""
        if offer["key"] in cure:
            found.setdefault(f"{topic} {offer['key']}".strip(), offer["value"])
    return found


def write(group: dict[str, Any], changes: Mapping[str, str]) -> None:
    """Write what was offered into the group of a file."""
    for where, value in changes.items():
        topic, _, key = where.rpartition(" ")
        for owner in [row for row in group["topics"] if row["topic"] == topic] if topic else [group]:
            owner[key] = int(value) if value.isdecimal() else value
