"""The topics that the node itself has, beside those of its groups."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final, NamedTuple

from syncrelay.config.document import Document, plain
from syncrelay.config.drafts import GroupDraft
from syncrelay.config.problems import Problem

DIAGNOSTICS: Final = "/diagnostics"
SCALARS: Final = ("sets_hz", "span_ms", "latency_ms")
"""Figures of a group, each on a topic `~/GROUP/FIGURE`."""


class OwnTopic(NamedTuple):
    """The type of a topic that the node publishes or listens to by itself, and what it is for."""

    type: str
    purpose: str


_OF_EVERY_NODE: Final = {
    "/rosout": OwnTopic("rcl_interfaces/msg/Log", "its log"),
    "/parameter_events": OwnTopic("rcl_interfaces/msg/ParameterEvent", "changes of its parameters"),
    "/clock": OwnTopic("rosgraph_msgs/msg/Clock", "simulated time"),
}


def check_own_topics(
    groups: Sequence[GroupDraft], document: Document, absolute: Callable[[str], str]
) -> Iterator[Problem]:
    """Yield outputs onto the node's own topics, and inputs that make another type of one: DDS refuses both.

    `absolute` gives the name that a topic has, as it gave those of the groups.
    """
    own = _own_topics(groups, document, absolute)
    for topic in (topic for group in groups for topic in group.topics):
        if topic.output in own:
            text = (
                f"the output {topic.output_said} is a topic of the node itself, for {own[topic.output].purpose}:"
                " give it another `output`"
            )
            span = document.value_span(topic.output_path)
            yield document.problem(topic.output_path, text, code="own_topic", span=span)
        if topic.topic in own and topic.type not in (None, own[topic.topic].type):
            text = (
                f"{topic.topic_said} is a topic of the node itself, for {own[topic.topic].purpose}, and of the type"
                f" `{own[topic.topic].type}`: one topic has one type"
            )
            path = (*topic.path, "type")
            yield document.problem(path, text, code="conflict", span=document.value_span(path))


def _own_topics(
    groups: Sequence[GroupDraft], document: Document, absolute: Callable[[str], str]
) -> dict[str, OwnTopic]:
    node = document.find(("diagnostics",))
    asked = plain(node) if node is not None else {}
    own = {absolute(name): topic for name, topic in _OF_EVERY_NODE.items()}
    if asked is not None:
        own[absolute(DIAGNOSTICS)] = OwnTopic("diagnostic_msgs/msg/DiagnosticArray", "its diagnostics")
    if isinstance(asked, dict) and asked.get("scalars") is True:
        for group in groups:
            for figure in SCALARS:
                purpose = f"`{figure}` of the group {group.name}"
                own[absolute(f"~/{group.name}/{figure}")] = OwnTopic("std_msgs/msg/Float64", purpose)
    return own
