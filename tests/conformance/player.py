"""Plays a script in a ROS, real or simulated, and notes what a user can see."""

import json
import logging
import os
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message
from rclpy.time import Time

from syncrelay.config import load_text
from syncrelay.config.interfaces import Interfaces
from syncrelay.config.profile import Profile
from syncrelay.explain.facts import InputFacts
from syncrelay.explain.judge import explanation
from syncrelay.relay.listening import Heard, Listener
from syncrelay.relay.look import look
from syncrelay.relay.ports import EndpointInfo, Purpose
from syncrelay.relay.relay import Relay
from syncrelay.status.as_document import status_of
from tests.conformance.script import PAIR, VECTOR, Script
from tests.conformance.seen import MS, Seen, by_reason, endpoint, message, short_of, without_figures
from tests.conformance.world import Reader, World, Writer
from tests.ros.cdr_messages import vector
from tests.ros.transforms import transforms
from tests.simulated.node import MADE
from tests.simulated.running import Running

_LOG: Final = logging.getLogger("syncrelay")
_HOUR: Final = 3600 * 10**9
# That Fast DDS hangs; whether a node's name comes before its publishers; what is said again where a script takes long.
_BY_CHANCE: Final = re.compile("DDS did not let this node go|not known yet|no (more )?sets? for ")


class _Running(Running):
    """The relay, on a thread that keeps what it raises for the test."""

    error: BaseException | None = None

    def main(self) -> None:
        try:
            super().main()
        except Exception as error:  # noqa: BLE001  raised where the test waits
            self.error = error
        self.has_ended = True


class Recorder(logging.Handler):
    """The relay's log."""

    def __init__(self, monotonic: Callable[[], float]) -> None:
        super().__init__(logging.INFO)
        self._monotonic, self._began = monotonic, monotonic()
        self.texts: list[str] = []
        self.lines: list[str] = []
        """The first line of each, after the seconds from the begin; with what was made in DDS."""
        self.warnings: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage() + (f"\n{record.exc_info[1]!r}" if record.exc_info else "")
        self.lines.append(f"{self._monotonic() - self._began:.1f} {text.splitlines()[0]}")
        if record.name == MADE:
            return
        self.texts.append(text)
        if record.levelno >= logging.WARNING:
            self.warnings.append(text)


class Player:
    """The verbs of scripts. Times in scripts are milliseconds from the script's begin."""

    def __init__(self, world: World, folder: Path, recorder: Recorder) -> None:
        self._world, self._folder, self._recorder = world, folder, recorder
        self._begin = world.runtime.time_ns()
        self._writers: dict[str, tuple[Writer, str]] = {}
        self._readers: dict[str, Reader] = {}
        self._topics: dict[str, str] = {}
        self._held: dict[str, object] = {}
        self._running: _Running | None = None
        self.seen = Seen()

    def publisher(
        self,
        topic: str,
        *,
        of: str = VECTOR,
        by: str = "rig",
        node: str = "",
        name: str = "",
        **qos: Any,
    ) -> None:
        """Somebody publishes; `name` is for those that share a topic."""
        writer = self._world.writer(topic, of, Profile(**qos), by=by, node=node or by)
        self._writers[name or topic] = writer, topic

    def subscriber(
        self,
        topic: str,
        *,
        of: str = VECTOR,
        by: str = "ears",
        node: str = "",
        name: str = "",
        **qos: Any,
    ) -> None:
        """Somebody subscribes, with a history of 1000 unless told otherwise."""
        profile = Profile(**{"depth": 1000, **qos})
        self._readers[name or topic] = self._world.reader(topic, of, profile, by=by, node=node or by)
        self._topics[name or topic] = topic
        self.seen.outputs[name or topic] = []

    def relay(
        self,
        groups: Mapping[str, Any],
        *,
        node: Mapping[str, Any] | None = None,
        names: Mapping[str, str] | None = None,
        **sections: Any,
    ) -> None:
        """The relay starts; `names` are remaps."""
        self._path = self._folder / "fusion.yaml"
        self._node_keys = node or {}
        self.file(groups, **sections)
        world = self._world
        self._running = running = _Running(
            self._path, join=lambda config: world.join(config, names or {}), runtime=world.runtime
        )
        self._world.runtime.start("relay", running.main)
        self._until(lambda: running.relay is not None or running.error, "the relay")

    def listen(self, seconds: float) -> None:
        """Somebody listens to the graph, as `syncrelay init` does; `heard` notes what came."""
        node, backend = self._world.join(load_text(json.dumps({"version": 1, "groups": PAIR})), {})
        found = Interfaces.find(os.environ)
        listener = Listener(node, backend, seconds=seconds, interfaces=found, runtime=self._world.runtime)
        self._heard: list[Heard] = []

        def listened() -> None:
            self._heard.append(listener.run())
            node.leave()

        self._world.runtime.start("listen", listened)

    def heard(self) -> None:
        """What was heard is noted."""
        self._until(lambda: self._heard, "the end of listening")
        heard, reliable = self._heard[0], {True: "reliable", False: "best_effort"}
        vectors = [each for each in heard.topics if each.type == VECTOR]
        places = sorted(place for each in vectors for place in each.places)
        for each in vectors:
            stamps = [None if stamp is None else (stamp - self._begin) / MS for stamp in each.stamps]
            in_order = [*each.received] == sorted(each.received)
            self._note(each.name, reliable[each.is_reliable], stamps, [*map(places.index, each.places)], in_order)
        self._note("relayed", *heard.relayed)
        self._note("without a header", *heard.headerless.items())
        self._note("unusable", *heard.unusable)

    def observe(self, groups: Mapping[str, Any], seconds: float) -> None:
        """Somebody observes groups, as `syncrelay observe` does; `observed` notes what it reports."""
        config = load_text(json.dumps({"version": 1, "groups": groups}))
        node, backend = self._world.join(config, {}, Purpose.OBSERVE)
        self._observed: list[Any] = []

        def observe() -> None:
            runtime, purpose = self._world.runtime, Purpose.OBSERVE
            began = runtime.monotonic()
            with Relay(config, node, backend, purpose=purpose, runtime=runtime) as relay:
                reports = look(relay, seconds)
            took = runtime.monotonic() - began
            self._note("looked for as long as asked", took >= seconds)
            self.seen.inside.append(f"looked for {took:.1f} s")
            self._observed.append(reports)

        self._world.runtime.start("observe", observe)

    def observed(self) -> None:
        """What was observed is noted."""
        self._until(lambda: self._observed, "the end of observing")
        for report in self._observed[0]:
            rivals = [endpoint.node for each in report.facts.inputs for endpoint in each.graph.rivals]
            self._note("observed", report.facts.name, *rivals)
            for each in report.facts.inputs:
                counts = each.counts
                self._note(each.name, counts.fed, counts.matched, by_reason(counts.dropped), each.graph.largest)

    def diagnosed(self, count: int) -> None:
        """The last message on /diagnostics, once it tells of so many received messages, is noted."""
        found: list[Any] = []

        def is_told() -> bool:
            reader = self._readers["/diagnostics"]
            while (content := reader.take()) is not None:
                found[:] = [deserialize_message(content, DiagnosticArray)]
            told = [value.value for each in found for status in each.status for value in status.values]
            return str(count) in told

        self._until(is_told, f"a diagnosis of {count} messages", lambda: found)
        self._note("stamped", abs(Time.from_msg(found[0].header.stamp).nanoseconds - self._begin) < _HOUR)
        for status in found[0].status:
            told = {each.key: each.value for each in status.values if each.key != "suggestion"}
            values = [f"{key}={value if value.isdigit() else self._blank(value)}" for key, value in told.items()]
            level = int.from_bytes(status.level, "little")
            self._note("diagnosed", status.name, level, status.hardware_id, *values)

    def file(self, groups: Mapping[str, Any], *, node: Mapping[str, Any] | None = None, **sections: Any) -> None:
        """The relay's file is written."""
        keys = {**self._node_keys, **(node or {})}
        self.text(json.dumps({"version": 1, "node": keys, "metrics": None, **sections, "groups": groups}))

    def text(self, text: str) -> None:
        """The relay's file holds this."""
        self._path.write_text(text)

    def remove(self) -> None:
        """The relay's file is removed."""
        self._path.unlink()

    def ready(self, *names: str) -> None:
        """All publishers and subscribers, or these, are connected with the relay, or somebody, in both directions."""
        for name in names or (*self._writers, *self._readers):
            self._until(partial(self._is_connected, name), f"somebody on the other side of {name}")

    def served(self, name: str, readers: int) -> None:
        """A publisher has this many subscribers."""
        self._until(lambda: self._writers[name][0].n_readers == readers, f"{readers} subscribers of {name}")

    def write(self, name: str, *stamps: float, frame: str = "", data: bytes | None = None) -> None:
        """A publisher publishes vectors with these stamps, or bytes."""
        for stamp in stamps:
            content = vector(self._begin + round(stamp * MS), frame_id=frame or name) if data is None else data
            self._writers[name][0].write(content)

    def absolute(self, name: str, *stamps: int) -> None:
        """A publisher publishes vectors with stamps since 1970, in nanoseconds."""
        for stamp in stamps:
            self._writers[name][0].write(vector(stamp, frame_id=name))

    def transform(self, name: str, parent: str, child: str, *stamps: float) -> None:
        """A publisher of transforms publishes one of each of these times."""
        for stamp in stamps:
            moved = transforms(name, (parent, child, self._begin + round(stamp * MS)))
            self._writers[name][0].write(moved.payload)

    def feed(self, name: str, *stamps: float, frame: str = "", data: bytes | None = None) -> None:
        """As `write`, one after the other: each once the relay has had the one before."""
        for stamp in stamps:
            count = self._fed(name) + 1
            self.write(name, stamp, frame=frame, data=data)
            self.fed(name, count)

    def sets(self, *stamps: float, of: tuple[str, ...] = ("/a", "/b"), frame: str = "") -> None:
        """All of these publish a message of each stamp, one after the other."""
        for stamp in stamps:
            for name in of:
                self.feed(name, stamp, frame=frame)

    def clock(self, *seconds: float) -> None:
        """The publisher of /clock publishes these times, each once the relay's clock shows the one before."""
        for each in seconds:
            now = round(each * 1e9)
            content = b"\0\1\0\0" + struct.pack("<iI", *divmod(now, 10**9))

            def shows(now: int = now, content: bytes = content) -> bool:
                # By best effort: what comes before the relay has found the publisher is lost.
                self.write("/clock", 0, data=content)
                return self._relay.node.ros_time_ns() == now

            self._until(shows, f"the clock at {each}")

    def fed(self, name: str, count: int) -> None:
        """The relay has had so many messages of a topic."""
        self._until(lambda: self._fed(name) >= count, f"message {count} of {name}")

    def out(self, name: str, count: int) -> None:
        """A subscriber has so many messages."""
        self._until(lambda: self._taken(name) >= count, f"message {count} on {name}")

    def take(self, name: str) -> None:
        """A subscriber takes what its history holds."""
        self._taken(name)

    def mark(self, name: str) -> None:
        """What a subscriber has got so far is noted."""
        self._note(name, *self.seen.outputs[name])

    def sleep(self, seconds: float) -> None:
        """Time passes, of which nothing is to be heard."""
        self._world.runtime.sleep(seconds)

    def end(self, name: str) -> None:
        """A publisher or subscriber ends."""
        (self._writers.pop(name)[0] if name in self._writers else self._readers.pop(name)).end()

    def leave(self, by: str, *names: str) -> None:
        """A process with these publishers and subscribers ends in order."""
        self._forget(names)
        self._world.leave(by)

    def kill(self, by: str, *names: str) -> None:
        """A process with these publishers is killed."""
        self._forget(names)
        self._world.kill(by)

    def hold(self, topic: str, of: str) -> None:
        """A part of the relay's process that is not ours publishes on a topic."""
        self._held[topic] = self._world.hold(self._relay.node, topic, of)

    def free(self, topic: str) -> None:
        """It publishes there no more."""
        self._world.free(self._relay.node, self._held.pop(topic))

    def finding(self, code: str, name: str = "front", *, naming: str = "", wordless: bool = False) -> None:
        """What explains most of a group's state is this, and names somebody; its words are noted."""
        found: list[Any] = []

        def is_found() -> bool:
            for report in self._reports():
                if report.facts.name == name:
                    found[:] = [explanation(report.findings)]
            # A node's name may come later than its publishers.
            return bool(found) and found[0].code.value == code and naming in f"{found[0].text} {found[0].suggestion}"

        self._until(is_found, f"the finding {code} of {name}", lambda: found)
        words = () if wordless else (self._blank(found[0].text), self._blank(found[0].suggestion or ""))
        self._note(code, *words)

    def counts(self, name: str = "front", *, buffered: int | None = None) -> None:
        """Where the messages of a group's inputs went is noted, once so many are buffered in all."""
        noted: list[Any] = []

        def is_so() -> bool:
            inputs = self._inputs(name)
            noted[:] = [
                (each.name, each.counts.fed, each.counts.matched, each.counts.buffered, by_reason(each.counts.dropped))
                for each in inputs
            ]
            return bool(inputs) and buffered in (None, sum(each[3] for each in noted))

        self._until(is_so, f"{buffered} buffered messages", lambda: noted)
        self._note("counts", *noted)

    def sent(self, topic: str, *, all_came: bool = True, **by: int) -> None:
        """Each node has sent so many messages on a topic, as the relay counts, and whether all came is as it is."""

        def counted() -> InputFacts:
            return next(each for report in self._reports() for each in report.facts.inputs if each.name == topic)

        def told() -> dict[str, int]:
            return {each.node.removeprefix("/"): each.sent_in_all for each in counted().graph.senders}

        self._until(lambda: told() == by, f"the messages of {by} on {topic}", told)
        each = counted()
        came = [(sender.sent_in_all, sender.delivered_in_all) for sender in each.graph.senders]
        assert sum(delivered for _, delivered in came) == each.counts.fed
        assert all(sent == delivered for sent, delivered in came) is all_came, came

    def dropped(self, reason: str, count: int, name: str = "front") -> None:
        """So many messages of a group were dropped for a reason."""

        def is_so() -> bool:
            return sum(by_reason(each.counts.dropped).get(reason, 0) for each in self._inputs(name)) >= count

        self._until(is_so, f"{count} dropped as {reason}")

    def endpoints(
        self,
        topic: str,
        *,
        publishers: int | None = None,
        subscribers: int | None = None,
        named: bool = False,
        **offered: str,
    ) -> None:
        """Who publishes and subscribes to a topic, with what QoS, is noted once there are so many.

        So it is once the publishers offer this; and with `named`, once the names of the nodes have come.
        """
        wanted, graph = (publishers, subscribers), self._world.graph

        def found() -> tuple[Sequence[EndpointInfo], ...]:
            return graph.publishers_of(topic), graph.subscribers_of(topic)

        def are_there() -> bool:
            return (
                all(number in (None, len(each)) for number, each in zip(wanted, found(), strict=True))
                and (not named or all(each.is_named for kind in found() for each in kind))
                and all(getattr(each.profile, key) == value for each in found()[0] for key, value in offered.items())
            )

        self._until(are_there, f"{publishers} publishers and {subscribers} subscribers of {topic}", found)
        told = [
            sorted(endpoint(each, named=named) for each in kind)
            for kind, number in zip(found(), wanted, strict=True)
            if number is not None
        ]
        self._note(topic, *told)

    def call(self, service: str) -> None:
        """A service is called, and its answer noted."""
        success, words = self._world.call(self._relay.node, service)
        self._note(service, success, self._blank(words))

    def transit(self, *names: str) -> None:
        """The node is asked for transitions, one after the other."""
        for name in names:
            self._note(name, *self._world.transition(self._relay.node, name))

    def hang_up(self, *, reloads: int = 0, refused: int = 0) -> None:
        """The relay gets SIGHUP, and has then reloaded, or refused to, so many times."""
        self._require.hang_up()
        self._until(
            lambda: (self._relay.state().reloads, self._relay.state().refused_reloads) == (reloads, refused),
            "the file to be read again",
        )
        self._note("reload error", self._blank(self._relay.state().reload_error or ""))

    def says(self, words: str) -> None:
        """The relay's log has these words."""
        self._until(lambda: any(words in each for each in self._recorder.texts), words)

    def settled(self) -> None:
        """No topic is polled any more until the graph changes, or what was refused is due again."""
        topics = self._relay._groups.bindings.topics  # noqa: SLF001
        self._until(lambda: not any(each.is_due for each in topics), "topics that need not be polled")

    def phase(self, phase: str) -> None:
        """The relay is in this phase."""
        self._until(lambda: self._reports() is not None and self._relay.state().phase.value == phase, f"phase {phase}")

    def stop(self) -> None:
        """The relay gets SIGTERM, and ends."""
        self._reports()
        state = self._relay.state()
        last = [len(each.last) for each in state.groups]
        self.seen.inside.append(f"{short_of(status_of(state).as_dict())} {last=} turned {state.turned_s:.1f} s ago")
        running, self._running = self._require, None
        running.end()
        self._until(lambda: running.has_ended, "the end of the relay")
        if running.error is not None:
            self._note(type(running.error).__name__, self._blank(str(running.error)))
        relay = running.relay
        for report in relay.monitor.reports if relay is not None else ():
            self._note(
                "at the end",
                report.facts.name,
                [
                    (each.name, each.counts.fed, each.counts.matched, by_reason(each.counts.dropped))
                    for each in report.facts.inputs
                ],
            )

    def conclude(self) -> Seen:
        """End what runs, take the last messages, and return what was seen."""
        if self._running is not None:
            self.stop()
        for name in self._readers:
            self._taken(name)
        self.seen.inside += [" | ".join(self._recorder.lines), ", ".join(self._world.left)]
        self.seen.inside = [each.replace(str(self._folder), "FOLDER") for each in self.seen.inside]
        self.seen.log = sorted({self._blank(each) for each in self._recorder.warnings if not _BY_CHANCE.search(each)})
        return self.seen

    def abandon(self) -> None:
        """End what still runs."""
        if self._running is not None:
            self._running.end()
            self._world.wait_until(lambda: self._running is None or self._running.has_ended, "the end of the relay")

    @property
    def _require(self) -> _Running:
        assert self._running is not None
        if self._running.error is not None:
            raise self._running.error
        return self._running

    @property
    def _relay(self) -> Relay:
        relay = self._require.relay
        assert relay is not None
        return relay

    def _reports(self) -> Any:
        return self._relay.call(self._relay.evaluate).result()

    def _inputs(self, group: str) -> Sequence[InputFacts]:
        return next((each.facts.inputs for each in self._reports() if each.facts.name == group), ())

    def _fed(self, name: str) -> int:
        topic = self._writers[name][1]
        inputs = [each for report in self._reports() for each in report.facts.inputs if each.name == topic]
        return sum(each.counts.fed for each in inputs)

    def _is_connected(self, name: str) -> bool:
        # Each side finds the other for itself: what is sent before it has found the writer, a volatile reader misses.
        if name in self._writers:
            writer, topic = self._writers[name]
            inputs = [each for report in self._reports() for each in report.facts.inputs] if self._running else []
            return writer.n_readers > 0 and all(each.graph.publishers for each in inputs if each.name == topic)
        if not self._readers[name].n_writers:
            return False
        if self._running is None:
            return True
        node = self._relay.node
        topics = self._relay._groups.bindings.topics  # noqa: SLF001
        found = [output for topic in topics for output in topic.outputs.all]
        outputs = {node.resolve_topic(each.topic): each.publisher or each.bundle.publisher for each in found}
        publisher = outputs.get(self._topics[name])
        return self._topics[name] not in outputs or (publisher is not None and publisher.is_heard())

    def _taken(self, name: str) -> int:
        reader, texts = self._readers[name], self.seen.outputs[name]
        while (content := reader.take()) is not None:
            texts.append(message(content, self._begin))
        return len(texts)

    def _blank(self, text: str) -> str:
        return without_figures(text.replace(str(self._folder), "FOLDER"))

    def _forget(self, names: tuple[str, ...]) -> None:
        for name in names:
            self._writers.pop(name, None)
            self._readers.pop(name, None)

    def _until(self, condition: Callable[[], object], what: str, told: Callable[[], object] = lambda: "") -> None:
        try:
            self._world.wait_until(condition, what)
        except Exception as error:
            raise AssertionError(f"{error}; {told()}") from error

    def _note(self, *words: Any) -> None:
        self.seen.notes.append(words)


def play(script: Script, world: World, folder: Path) -> Seen:
    """Play a script in a ROS."""
    recorder, level = Recorder(world.runtime.monotonic), _LOG.level
    _LOG.addHandler(recorder)
    _LOG.setLevel(logging.INFO)
    player = Player(world, folder, recorder)
    try:
        for step in script.steps:
            getattr(player, step.verb)(*step.words, **step.keys)
        return player.conclude()
    finally:
        player.abandon()
        _LOG.setLevel(level)
        # With what a relay that never came to its end has left.
        _LOG.handlers.clear()
