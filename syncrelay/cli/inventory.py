"""`syncrelay analyze BAG` and nothing more: what a recording holds, and what to type next."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from shlex import quote
from typing import Any, Final

from syncrelay.cli.analysis_text import faults_of
from syncrelay.cli.boundary import put
from syncrelay.cli.reading import reading
from syncrelay.config.wording import counted
from syncrelay.doctor.text import aligned
from syncrelay.explain import words
from syncrelay.printable import printable
from syncrelay.recordings.analysis import Topic, inventory
from syncrelay.recordings.bag import Recording

_HEADING: Final = ("topic", "type", "messages", "rate", "stamps")


def put_inventory(bag: str, recording: Recording, *, is_json: bool, indent: int | None) -> None:
    """Read a recording to its end and print its topics, types, counts, rates and stamps."""
    with reading(recording):
        topics = inventory(recording)
    if is_json:
        put(json.dumps(inventory_as_json(bag, recording, topics), indent=indent))
        return
    messages = sum(topic.figures.messages for topic in topics)
    lasts = words.seconds(recording.end - recording.begin)
    put(f"{printable(bag)}: {lasts}, {counted(messages, 'message')} of {counted(len(topics), 'topic')}")
    for line in aligned([_HEADING, *map(_row, topics)]):
        put(line)
    for line in _next(bag, [topic.channel.topic for topic in topics if topic.unfit is None]):
        put(line)


def inventory_as_json(bag: str, recording: Recording, topics: Sequence[Topic]) -> dict[str, Any]:
    """Return what json.dumps takes, in the form of an analysis without groups; `unfit` as Topic has it."""
    return {
        "recording": bag,
        "begin": recording.begin,
        "end": recording.end,
        "faults": recording.faults,
        "topics": [{**asdict(topic.figures), "unfit": topic.unfit} for topic in topics],
        "groups": [],
    }


def _row(topic: Topic) -> tuple[str, ...]:
    figures = topic.figures
    rate = words.rate(figures.rate_hz) if figures.rate_hz else "-"
    return topic.channel.topic, topic.channel.type or "-", str(figures.messages), rate, _stamps(topic)


def _stamps(topic: Topic) -> str:
    if topic.lack is not None:
        return f"none: {topic.lack}"
    if not topic.figures.messages:
        return "-"
    faults, delay = faults_of(topic.figures), topic.figures.delay
    if delay is None:
        return ", ".join(faults) or "equal to receipt"
    return ", ".join([f"{words.span_of_time(delay.median)} before receipt", *faults])


def _next(bag: str, fit: Sequence[str]) -> Iterator[str]:
    """Yield what to type with this recording, whose name is quoted for a shell."""
    name = quote(printable(bag))
    yield ""
    if len(fit) < 2:  # noqa: PLR2004  one alone has nothing to be matched with
        yield "No two topics have stamps and enough messages. In a file, `stamp: receive` matches a topic by arrival."
        return
    yield "Next, to match two topics or more:"
    yield f"  syncrelay analyze {name} {' '.join(fit[:2])}"
    yield "or to get a file for all of them, and see what it gives:"
    yield f"  syncrelay init --from-bag {name} -o fusion.yaml"
    yield f"  syncrelay analyze {name} --config fusion.yaml"
