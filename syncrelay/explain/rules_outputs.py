"""Findings about what leaves: who takes it, and who else publishes it."""

from collections.abc import Sequence
from typing import Final

from syncrelay.config.wording import one_of
from syncrelay.explain.codes import Severity
from syncrelay.explain.facts import GroupFacts, InputFacts
from syncrelay.explain.findings import SECOND, Fault, Found
from syncrelay.explain.graph_facts import BundleGraph, Endpoint, InputGraph

# A relay that ends in order while its successor starts is gone after this time.
_ENDING: Final = 3 * SECOND


def nobody_listens(facts: GroupFacts) -> Found:
    """Find that a lazy group sleeps, as it should."""
    if facts.asleep:
        outputs = [each for each in facts.inputs if each.graph.publishers] or facts.inputs
        subscribers = {each.output: each.graph.subscribers for each in outputs}
        if facts.bundle is not None:
            subscribers[facts.bundle.name] = facts.bundle.subscribers
        names, some = one_of(subscribers), any(subscribers.values())
        who = f"no subscriber of {names} fits what the relay offers" if some else f"nobody subscribes to {names}"
        yield Fault(f"{who}, so this lazy group receives nothing", severity=Severity.OK)


def subscriber_qos(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find subscribers of an output that the relay's QoS cannot serve."""
    if facts.bundle is None or an_input.output != facts.bundle.name:
        yield from _unserved(an_input.graph.subscribers, an_input.output, f"{an_input.name}'s publisher")


def bundle_subscriber_qos(facts: GroupFacts) -> Found:
    """Find subscribers of the bundle that the relay's QoS cannot serve."""
    if facts.bundle is not None:
        yield from _unserved(facts.bundle.subscribers, facts.bundle.name, "`qos` of the bundle")


def _unserved(subscribers: Sequence[Endpoint], output: str, other: str) -> Found:
    for subscriber in subscribers:
        if (why := subscriber.mismatch) is not None:
            yield Fault(
                f"{subscriber.node} requests {output} with {why.policy} {why.requested}, the relay offers"
                f" {why.offered}, so it gets nothing",
                f"have {subscriber.node} request {why.offered}, or {other} offer {why.requested}",
            )


def output_taken(facts: GroupFacts, _index: int, an_input: InputFacts) -> Found:
    """Find others that publish an output, as a second relay of the same file does."""
    if facts.bundle is None or an_input.output != facts.bundle.name:
        yield from _taken(facts, an_input.graph, an_input.output, "this output another name with `output: ...`")


def bundle_taken(facts: GroupFacts) -> Found:
    """Find others that publish the topic of the bundle."""
    if facts.bundle is not None:
        yield from _taken(facts, facts.bundle, facts.bundle.name, "the bundle another `topic`")


def _taken(facts: GroupFacts, graph: InputGraph | BundleGraph, output: str, another: str) -> Found:
    if graph.rivals and facts.figures.now - graph.rivals_since >= _ENDING:
        they = " and ".join(dict.fromkeys(each.node for each in graph.rivals))
        verb, whose = ("publishes", "both") if len(graph.rivals) == 1 else ("publish", "all")
        yield Fault(
            f"{they} {verb} {output} too: its subscribers get the messages of {whose}",
            f"stop all publishers but one, or give {another}; a node that was killed stays in the graph for 20 s",
        )
