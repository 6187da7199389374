"""What single keys can't tell: names that meet, topics that groups share, a restamp that names no input."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from syncrelay.config.document import Document, MappingNode, ScalarNode, SequenceNode, plain
from syncrelay.config.drafts import GroupDraft, TopicDraft, node_name, remapped_from
from syncrelay.config.names import LONGEST_TOPIC
from syncrelay.config.problems import Path, Problem, Severity
from syncrelay.config.units import MAX_NS, NS_PER_UNIT
from syncrelay.config.wording import quoted

# The longest of what every node offers below its name.
_LONGEST_NODE = LONGEST_TOPIC - len("/set_parameters_atomically")
# What is longer is refused as out of range.
_LONGEST_S = MAX_NS // NS_PER_UNIT["s"]
_RESTAMP_WORDS = ("none", "earliest", "latest")


def check_between(groups: Sequence[GroupDraft], document: Document) -> Iterator[Problem]:
    """Yield what is wrong between the keys of a file, types aside."""
    yield from _too_few(groups, document)
    yield from _node(document)
    for group in groups:
        yield from _restamp(group, document)
        yield from _trigger(group, document)
        yield from _keys(group, document)
        yield from _optional_inputs(group, document)
        yield from _unit(group, document)
    yield from check_names(groups, document)


def check_names(groups: Sequence[GroupDraft], document: Document) -> Iterator[Problem]:
    """Yield what is wrong between the names of topics, be they the file's own or what remaps make of them."""
    for group in groups:
        yield from _repeated_inputs(group, document)
    yield from _shared_topics(groups, document)
    yield from _outputs(groups, document)
    yield from _too_long(groups, document)


def _too_few(groups: Sequence[GroupDraft], document: Document) -> Iterator[Problem]:
    node = document.find(("groups",))
    if isinstance(node, MappingNode) and not node.entries:
        yield _at(document, ("groups",), "expected one group or more, found none", code="too_few")
    for group in groups:
        path = (*group.path, "topics")
        topics = document.find(path)
        if isinstance(topics, SequenceNode) and len(topics.items) < 2:  # noqa: PLR2004  one has nothing to match
            count = "none" if not topics.items else "one"
            yield _at(document, path, f"expected 2 topics or more, found {count}", code="too_few", at_key=True)


def _repeated_inputs(group: GroupDraft, document: Document) -> Iterator[Problem]:
    first: dict[str, TopicDraft] = {}
    for topic in group.topics:
        if topic.topic is None:
            continue
        if topic.topic in first:
            path = (*topic.path, "topic")
            line = _line_of_topic(first[topic.topic], document, beside=path)
            text = f"{topic.topic_said} is in this group twice, first in {line}"
            yield _at(document, path, text, code="repeated_topic")
        first.setdefault(topic.topic, topic)


def _node(document: Document) -> Iterator[Problem]:
    """Yield a name and namespace that are too long together."""
    name = node_name(document)
    if len(name) > _LONGEST_NODE:
        path = ("node", "namespace") if document.find(("node", "namespace")) else ("node", "name")
        text = (
            f"the node's full name has {len(name)} characters, at most {_LONGEST_NODE} are allowed: it becomes part of"
            " the names of its services"
        )
        yield _at(document, path, text, code="bad_value")


def _restamp(group: GroupDraft, document: Document) -> Iterator[Problem]:
    inputs = [topic.topic for topic in group.topics if topic.topic]
    if group.restamp in _RESTAMP_WORDS or group.restamp_topic in inputs:
        return
    hint = document.did_you_mean(group.restamp, (*_RESTAMP_WORDS, *inputs))
    text = f"{quoted(group.restamp)} is not an input of this group, nor none, earliest or latest{hint}"
    yield _at(document, (*group.path, "restamp"), text, code="bad_value")


def _trigger(group: GroupDraft, document: Document) -> Iterator[Problem]:
    if group.trigger is None:
        return
    inputs = {topic.topic: topic for topic in group.topics if topic.topic}
    path = (*group.path, "trigger")
    if group.trigger_topic not in inputs:
        hint = document.did_you_mean(group.trigger, inputs)
        yield _at(document, path, f"{quoted(group.trigger)} is not an input of this group{hint}", code="bad_value")
    elif not inputs[group.trigger_topic].is_required:
        text = f"{quoted(group.trigger)} triggers every set, so it cannot be optional (`required: false`)"
        yield _at(document, path, text, code="conflict")


def _keys(group: GroupDraft, document: Document) -> Iterator[Problem]:
    for topic in group.topics if group.needs_key else ():
        if document.find(topic.key_path) is None:
            text = "missing, equal_key needs the field to match by, here or in the group: `key: header.frame_id`"
            yield _at(document, (*topic.path, "key"), text, code="missing")


def _optional_inputs(group: GroupDraft, document: Document) -> Iterator[Problem]:
    optional = [topic for topic in group.topics if not topic.is_required]
    if optional and len(optional) == len(group.topics):
        text = "all inputs of this group are optional, expected one or more without `required: false`"
        yield _at(document, (*group.path, "topics"), text, code="conflict", at_key=True)
    if optional and group.needs_max_wait:
        text = "an optional input needs the group's `max_wait`: how long a set waits for it, for example 100ms"
        yield _at(document, (*optional[0].path, "required"), text, code="missing")


def _unit(group: GroupDraft, document: Document) -> Iterator[Problem]:
    """Yield a slop of whole seconds that is written without a unit: milliseconds are what people mean."""
    path = (*group.path, "slop")
    node = document.find(path)
    slop = plain(node) if isinstance(node, ScalarNode) else None
    if isinstance(slop, int | float) and not isinstance(slop, bool) and 1 <= slop <= _LONGEST_S:
        number = f"{slop:.15g}"
        text = f"{number} without a unit is {number} s; write {number}ms if milliseconds are meant, else {number}s"
        problem = _at(document, path, text, code="unit")
        yield replace(problem, severity=Severity.NOTE)


def _shared_topics(groups: Sequence[GroupDraft], document: Document) -> Iterator[Problem]:
    first: dict[str, TopicDraft] = {}
    for topic in _topics(groups):
        if topic.topic is None:
            continue
        other = first.setdefault(topic.topic, topic)
        if other is topic:
            continue
        if topic.type and other.type and topic.type != other.type:
            path = (*topic.path, "type")
            line = document.line((*other.path, "type"), beside=path)
            text = f"{topic.topic_said} is {quoted(other.type)} in {line}, and one topic has one type"
            yield _at(document, path, text, code="conflict")
        if topic.qos != other.qos:
            yield _qos_conflict(topic, other, document)


def _qos_conflict(topic: TopicDraft, other: TopicDraft, document: Document) -> Problem:
    own = (*topic.path, "qos")
    path = own if document.find(own) else (*topic.path, "topic")
    others = (*other.path, "qos") if document.find((*other.path, "qos")) else (*other.path, "topic")
    line = document.line(others, beside=path)
    text = f"{topic.topic_said} has another `qos` in {line}: it is subscribed once, write the same in both"
    return _at(document, path, text, code="conflict")


def _outputs(groups: Sequence[GroupDraft], document: Document) -> Iterator[Problem]:
    inputs = {topic.topic: topic for topic in reversed(list(_topics(groups))) if topic.topic}
    outputs: dict[str, TopicDraft] = {}
    for topic in _topics(groups):
        if topic.output is None:
            continue
        name = topic.output_said
        what = f"the output {name}" if topic.has_own_output else f"the default output {name}"
        if topic.output in inputs:
            line = _line_of_topic(inputs[topic.output], document, beside=topic.output_path)
            text = f"{what} is an input too ({line}): its messages would come back, give it another `output`"
            yield _at(document, topic.output_path, text, code="loop")
        elif topic.output in outputs:
            other = outputs[topic.output]
            line = document.line(other.output_path, beside=topic.output_path) + remapped_from(other.output_before)
            text = f"{what} is taken by {line}, give it another `output`"
            yield _at(document, topic.output_path, text, code="repeated_output")
        outputs.setdefault(topic.output, topic)


def _line_of_topic(topic: TopicDraft, document: Document, *, beside: Path) -> str:
    return document.line((*topic.path, "topic"), beside=beside) + remapped_from(topic.topic_before)


def _too_long(groups: Sequence[GroupDraft], document: Document) -> Iterator[Problem]:
    """Yield names that only their namespace or prefix makes too long."""
    for topic in _topics(groups):
        for name, path in ((topic.topic, (*topic.path, "topic")), (topic.output, topic.output_path)):
            if name is not None and len(name) > LONGEST_TOPIC:
                text = f"{quoted(name)} has {len(name)} characters in full, at most {LONGEST_TOPIC} are allowed"
                yield _at(document, path, text, code="bad_value")


def _topics(groups: Iterable[GroupDraft]) -> Iterator[TopicDraft]:
    for group in groups:
        yield from group.topics


def _at(document: Document, path: Path, text: str, *, code: str, at_key: bool = False) -> Problem:
    span = document.key_span(path) if at_key else document.value_span(path)
    return document.problem(path, text, code=code, span=span)
