"""Runs a case: feeds its messages to the engine and the judge, and compares the result with what is expected."""

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from decimal import Decimal
from typing import Final, NamedTuple, TypeAlias

from syncrelay.config import ConfigError, GroupConfig, Problem
from syncrelay.config.problems import Path
from syncrelay.config.source import shown_name
from syncrelay.errors import SyncRelayError
from syncrelay.explain import UNREADABLE, Code, Distribution, EngineDriver
from syncrelay.recordings.analysis.evaluation import Evaluation, evaluate
from syncrelay.recordings.analysis.streams import Stream, read_streams
from syncrelay.recordings.analysis.watching import LASTING_NS, watch_group
from syncrelay.recordings.bag import open_recording
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.what_if import Disturbed
from syncrelay.recordings.cases.bounds import Bound, Quantity
from syncrelay.recordings.cases.load import LoadedCase, Suite, load_suite
from syncrelay.recordings.cases.models import InputExpectation
from syncrelay.recordings.cases.sources import START, Arrival, arrivals, streams
from syncrelay.sync import Match, Message, Outcome
from syncrelay.yaml_files import yaml_files

_P95: Final = 0.95


@dataclass(frozen=True, slots=True)
class Mismatch:
    """A difference between what the file expects at `path` and what was found, both as lines."""

    path: Path
    expected: tuple[str, ...]
    found: tuple[str, ...]

    @property
    def is_drawn(self) -> bool:
        """Whether a drawing differs."""
        return self.path[-1] == "drawing"


@dataclass(frozen=True, slots=True)
class Result:
    """The result of a case, and how many seconds it took. `error` says why it could not be run.

    `remarks` name damage of a recording, and faults that changed nothing.
    """

    case: LoadedCase
    mismatches: tuple[Mismatch, ...]
    seconds: float
    error: str | None = None
    remarks: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether everything was as expected."""
        return self.error is None and not self.mismatches


class Ran(NamedTuple):
    """What came of a test file: the result of one of its cases, or the problems for which it could not be run."""

    file: str
    outcome: Result | Sequence[Problem]


def run_files(paths: Sequence[str]) -> Iterator[Ran]:
    """Run the cases of test files, or of all files of a directory."""
    for file in (file for path in paths for file in yaml_files(path)):
        try:
            suite = load_suite(file)
        except ConfigError as error:
            yield Ran(shown_name(file), error.problems)
        else:
            yield from (Ran(shown_name(file), result) for result in check(suite))


def check(suite: Suite) -> Iterator[Result]:
    """Run the cases of a test file one after another."""
    for case in suite.cases:
        began = time.perf_counter()
        remarks: list[str] = []
        try:
            mismatches, error = tuple(_mismatches(case, suite, remarks)), None
        except SyncRelayError as raised:
            mismatches, error = (), str(raised)
        yield Result(case, mismatches, time.perf_counter() - began, error, tuple(remarks))


def _mismatches(loaded: LoadedCase, suite: Suite, remarks: list[str]) -> Iterator[Mismatch]:
    if loaded.recording is not None:
        yield from _compared(loaded, *_recorded(loaded, loaded.recording, suite, remarks))
        return
    case = loaded.case
    received, idle = arrivals(case, loaded.drawing, loaded.group, loaded.places, loaded.what_if)
    remarks += idle
    drawing = loaded.drawing
    # A drawing beside which only figures are expected says nothing of when they come.
    if drawing is not None and (drawing.expected or case.expect is None):
        left = tuple(_left(loaded.group, received, end=START + (drawing.width - 1) * case.period, of=loaded))
        if list(left) != drawing.expected:
            yield Mismatch(("cases", loaded.name, "drawing"), tuple(drawing.expected), left)
    drawn = 0 if drawing is None else drawing.width * case.period
    yield from _compared(loaded, loaded.group, streams(received, loaded.group), START + max(drawn, case.lasts or 0))


def _recorded(
    loaded: LoadedCase, path: str, suite: Suite, remarks: list[str]
) -> tuple[GroupConfig, Sequence[Stream], int]:
    """Return the group as it is bound to the recording, the streams of its inputs, and when the recording ends.

    Raises BagError where it cannot be read, and UsageError for a fault of a topic that it lacks.
    """
    with closing(open_recording([path], tell=remarks.append)) as opened:
        disturbed = Disturbed(opened, loaded.what_if, seed=loaded.case.seed) if loaded.what_if else None
        recording = opened if disturbed is None else disturbed
        binding = next(each for each in bind(suite.config, recording) if each.group.name == loaded.group.name)
        if not binding.is_complete:
            raise SyncRelayError("; ".join(binding.problems))
        (found,) = read_streams(recording, [binding])
        remarks += [*binding.problems, *recording.faults, *(() if disturbed is None else disturbed.idle())]
    return binding.group, found, recording.end


def _left(group: GroupConfig, received: Sequence[Arrival], *, end: int, of: LoadedCase) -> Iterator[str]:
    """Yield what leaves up to the end of a drawing, as it would be drawn; what waits then is not told."""
    lines: list[tuple[str, list[str]]] = []
    moment = ""

    def take(outcomes: Sequence[Outcome], now: int) -> None:
        because = moment if now == at and moment else f"@{_column(now, of.case.period)}"
        texts = [text for outcome in outcomes if (text := _outcome_text(outcome))]
        if texts:
            lines.append((because, texts))

    driver = EngineDriver(group, take)
    at = 0
    for each in received:
        at, moment = each.received, ""
        driver.expire(at)
        moment = each.letter
        message = Message(each.input, each.stamp, each.letter, each.key)
        if each.stamp == UNREADABLE:
            driver.reject(each.input, each.letter, now=at)
        else:
            driver.add(message, now=at)
    moment = ""
    driver.expire(end)
    yield from (f"{because}: {', '.join(told)}" for because, told in lines)


def _column(now: int, period: int) -> str:
    """Return the column of a time in the drawing."""
    return f"{(Decimal(now - START) / period).quantize(Decimal('0.001')).normalize():f}"


def _outcome_text(outcome: Outcome) -> str:
    """Return a set or a drop by its letters; nothing for what was not drawn."""
    if not isinstance(outcome, Match):
        return f"{outcome.message.payload} {outcome.reason.value}" if outcome.message.payload else ""
    there = [message for message in outcome.messages if message is not None]
    text = "".join("-" if message is None else message.payload or "*" for message in outcome.messages)
    if outcome.stamp is None:
        return text
    if outcome.stamp == outcome.tick:
        return f"{text} stamped tick"
    stamped = next((str(message.payload) for message in there if message.stamp == outcome.stamp), "?")
    return f"{text} stamped {stamped}"


def _compared(loaded: LoadedCase, group: GroupConfig, found: Sequence[Stream], end: int) -> Iterator[Mismatch]:
    """Yield what is not as expected; messages come until `end` if they come.

    Raises SyncRelayError where what is expected could not fail.
    """
    expect, path = loaded.case.expect, ("cases", loaded.name, "expect")
    heard = [stream.received for stream in found if len(stream.received)]
    if not heard and (expect is None or expect.received is None):
        raise SyncRelayError(
            "no message came to the group, so nothing is tested: if none should come, expect `received: 0`"
        )
    if expect is None:
        return
    evaluation = evaluate(group, found, until=end)
    yield from _of_bounds(expect, _figures(group, evaluation), path)
    for name, of_input in expect.inputs.items():
        index = loaded.places[name]
        yield from _of_bounds(of_input, _input_figures(evaluation, [index], index), (*path, "inputs", name))
    if expect.findings is not None:
        began = min((int(received[0]) for received in heard), default=end)
        lasts = max([end, *(int(received[-1]) for received in heard)]) - began
        if lasts < LASTING_NS:
            raise SyncRelayError(
                f"the messages of this case last {lasts / 1e9:.3g} s, so they cannot test `findings`, which are what"
                f" holds for {LASTING_NS / 1e9:g} s or longer"
            )
        codes = [each.finding.code.value for each in watch_group(group, found, evaluation)]
        codes = list(dict.fromkeys(codes)) or [(Code.HEALTHY if evaluation.sets else Code.STARTING).value]
        if set(codes) != set(expect.findings):
            at = (*path, "findings")
            yield Mismatch(at, (", ".join(expect.findings) or "none",), (", ".join(codes),))


_Figures: TypeAlias = Mapping[str, Decimal | None]


def _of_bounds(expect: InputExpectation, figures: _Figures, path: Path) -> Iterator[Mismatch]:
    """Yield which figures are not as they shall be; in the order of the models."""
    for key in type(expect).model_fields:
        bound = getattr(expect, key)
        if isinstance(bound, Bound):
            yield from _of_bound(bound, figures[key], (*path, key))
    for reason, bound in expect.drops.items():
        yield from _of_bound(bound, figures.get(reason, Decimal()), (*path, "drops", reason))


def _of_bound(bound: Bound, found: Decimal | None, path: Path) -> Iterator[Mismatch]:
    if found is None:
        lack = "no message came" if bound.quantity is Quantity.SHARE else "no set left"
        yield Mismatch(path, (str(bound),), (lack,))
    elif not bound.holds(found):
        yield Mismatch(path, (str(bound),), (bound.told(found),))


def _figures(group: GroupConfig, evaluation: Evaluation) -> _Figures:
    counts = evaluation.counts
    fed = [each.fed for each in counts]
    rarest = min(group.enough(fed), key=fed.__getitem__) if group.trigger is None else group.trigger
    spans = Distribution(evaluation.sets.spans[:].tolist())
    latencies = Distribution(evaluation.sets.latencies[:].tolist())
    return {
        **_input_figures(evaluation, range(len(counts)), rarest),
        "sets": Decimal(len(evaluation.sets)),
        "span_p95": _quantile(spans, _P95),
        "span_max": _quantile(spans, 1),
        "latency_p95": _quantile(latencies, _P95),
        "latency_max": _quantile(latencies, 1),
    }


def _quantile(values: Distribution, share: float) -> Decimal | None:
    return Decimal(values.quantile(share)) if len(values) else None


def _input_figures(evaluation: Evaluation, inputs: Sequence[int], rated: int) -> _Figures:
    """Return the figures of inputs together; the match rate is that of one of them."""
    counts = [evaluation.counts[index] for index in inputs]
    dropped = Counter[str]()
    for each in counts:
        dropped.update({reason.value: count for reason, count in each.dropped.items()})
    of = evaluation.counts[rated]
    return {
        "received": Decimal(sum(each.fed for each in counts)),
        "in_sets": Decimal(sum(each.matched for each in counts)),
        "match_rate": Decimal(of.matched) / of.fed if of.fed else None,
        "dropped": Decimal(sum(dropped.values())),
        **{reason: Decimal(count) for reason, count in dropped.items()},
    }
