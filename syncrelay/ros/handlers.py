"""What handles the messages of a topic for an input of a group: it reads the stamp and the key from the bytes."""

from collections.abc import Callable
from typing import Any

from syncrelay.cdr import has_place_for_stamp
from syncrelay.dataflow.backend import Content, Deliver
from syncrelay.dataflow.group import GroupRelay
from syncrelay.ros.types import StampReader, begins_with_header, stamp_reader, value_reader


def handler(group: GroupRelay, index: int, message_type: Any) -> Deliver:
    """What handles messages of a type for an input of a group; raises TypeImportError where a field is not there.

    It raises nothing itself: an exception stops the group, and nobody else on the topic.
    """
    handle = _handler(group, index, message_type)
    topic = group.config.topics[index]
    if group.config.restamp is None or topic.stamp == "header" or not begins_with_header(message_type):
        return handle

    def handle_if_it_can_be_restamped(payload: Any, content: Content, received: int) -> None:
        try:
            if not has_place_for_stamp(content):
                group.receive(index, payload, received, None)
                return
        except Exception as error:  # noqa: BLE001  see above
            group.fail(error)
            return
        handle(payload, content, received)

    return handle_if_it_can_be_restamped


def _handler(group: GroupRelay, index: int, message_type: Any) -> Deliver:
    topic = group.config.topics[index]
    read_stamp = stamp_reader(topic.stamp, message_type)
    if topic.key is not None:
        return _by_key(group, index, read_stamp, value_reader(message_type, topic.key))
    return _by_stamp(group, index, read_stamp)


# A `try` costs nothing where nothing is raised; one more call for each message would.


def _by_stamp(group: GroupRelay, index: int, read_stamp: StampReader | None) -> Deliver:
    def handle(payload: Any, content: Content, received: int) -> None:
        try:
            group.receive(index, payload, received, read_stamp(content) if read_stamp else received)
        except Exception as error:  # noqa: BLE001  see `handler`
            group.fail(error)

    return handle


def _by_key(
    group: GroupRelay, index: int, read_stamp: StampReader | None, read_key: Callable[[Content], Any]
) -> Deliver:
    def handle(payload: Any, content: Content, received: int) -> None:
        try:
            key = read_key(content)
            stamp = None if key is None else read_stamp(content) if read_stamp else received
            group.receive(index, payload, received, stamp, key)
        except Exception as error:  # noqa: BLE001  see `handler`
            group.fail(error)

    return handle
