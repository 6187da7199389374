"""What a type checker knows of payloads: `make lint` checks this file, running it only shows that it runs."""

from typing import Any, assert_type

from syncrelay.sync import Drop, ExactTime, Match, Message, SyncGroup


def test_the_payloads_of_a_group_that_says_its_type_are_of_it() -> None:
    group: SyncGroup[str] = SyncGroup(ExactTime(n_inputs=1, queue_size=1))
    (outcome,) = group.add(Message(0, 1, "a"), now=1)
    assert_type(outcome, Match[str] | Drop[str])
    assert isinstance(outcome, Match)
    assert_type(outcome.messages, tuple[Message[str] | None, ...])
    group.add(Message(0, 2, 2), now=1)  # type: ignore[arg-type]  # not a str


def test_payloads_of_a_group_that_does_not_say_may_be_anything() -> None:
    group: SyncGroup = SyncGroup(ExactTime(n_inputs=1, queue_size=1))
    (outcome,) = group.add(Message(0, 1, "a"), now=1)
    assert isinstance(outcome, Match)
    (message,) = outcome.messages
    assert message is not None
    assert_type(message.payload, Any)
