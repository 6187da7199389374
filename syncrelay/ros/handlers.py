"""What handles the messages of a topic for an input of a group: it reads the stamp and the key from the bytes."""

from collections.abc import Callable
from typing import Any

from syncrelay.cdr import has_place_for_stamp, read_stamp
from syncrelay.dataflow.backend import Content, Deliver, Payload
from syncrelay.dataflow.group import GroupRelay
from syncrelay.ros.types import StampReader, begins_with_header, stamp_reader, value_reader


def handler(group: GroupRelay, index: int, message_type: Any) -> Deliver:
    """What handles messages of a type for an input of a group; raises TypeImportError where a field is not there.

    It raises nothing itself: an exception stops the group, and nobody else on the topic.
    """
    topic = group.config.topics[index]
    read = stamp_reader(topic.stamp, message_type)
    if read is read_stamp and topic.key is None:
        return group.flow.by_header(index, group.fail)
    read_key = None if topic.key is None else value_reader(message_type, topic.key)
    has_place = None
    if group.config.restamp is not None and topic.stamp != "header" and begins_with_header(message_type):
        has_place = has_place_for_stamp
    return _by_fields(group, index, read, read_key, has_place)


def _by_fields(
    group: GroupRelay,
    index: int,
    read: StampReader | None,
    read_key: Callable[[Content], Any] | None,
    has_place: Callable[[Content], bool] | None,
) -> Deliver:
    """Go by the stamp that is read, or by the receive time; of a message with no place for a common one, by none."""

    def handle(payload: Payload) -> None:
        try:
            content = payload.content()
            stamp = read(content) if read else payload.received
            key = read_key(content) if read_key else None
            if (read_key and key is None) or (has_place and not has_place(content)):
                stamp = None
            group.flow.receive(index, payload, stamp, key)
        except Exception as error:  # noqa: BLE001  see `handler`
            group.fail(error)

    return handle
