"""Scripts as data: steps by their verbs, which tests.conformance.player carries out in either ROS."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

VECTOR: Final = "geometry_msgs/msg/Vector3Stamped"
POINT: Final = "geometry_msgs/msg/PointStamped"
BOOL: Final = "std_msgs/msg/Bool"
STRING: Final = "std_msgs/msg/String"
IMAGE: Final = "sensor_msgs/msg/CompressedImage"
COLOR: Final = "std_msgs/msg/ColorRGBA"
MARKER: Final = "visualization_msgs/msg/Marker"
FLOAT: Final = "std_msgs/msg/Float64"
REFERENCE: Final = "sensor_msgs/msg/TimeReference"
CLOCK: Final = "rosgraph_msgs/msg/Clock"
ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
EVENT: Final = "lifecycle_msgs/msg/TransitionEvent"
TF: Final = "tf2_msgs/msg/TFMessage"


class Step(NamedTuple):
    """What is to be done, by a verb of Player."""

    verb: str
    words: tuple[Any, ...]
    keys: Mapping[str, Any]


class _Verbs:
    """Makes steps: `do.write("/a", 10)`."""

    def __getattr__(self, verb: str) -> Any:
        return lambda *words, **keys: Step(verb, words, keys)


do: Final = _Verbs()


class Script(NamedTuple):
    """What happens."""

    title: str
    steps: tuple[Step, ...]
    is_short: bool
    """Whether it is played on real DDS in `make test`, too."""
    blind: Sequence[str] = ()
    """Which fields of Seen depend on chance, or on the clock of a busy machine."""


def short(title: str, *steps: Step | tuple[Step, ...], blind: Sequence[str] = ()) -> Script:
    """A script that is played on real DDS each time."""
    return Script(title, tuple(_flat(steps)), is_short=True, blind=blind)


def long(title: str, *steps: Step | tuple[Step, ...], blind: Sequence[str] = ()) -> Script:
    """A script that is played on real DDS in the long form only."""
    return Script(title, tuple(_flat(steps)), is_short=False, blind=blind)


def _flat(steps: Iterable[Any]) -> Iterator[Step]:
    for each in steps:
        if isinstance(each, Step):
            yield each
        else:
            yield from _flat(each)


def group(*topics: str | Mapping[str, Any], policy: str = "exact_time", **keys: Any) -> dict[str, Any]:
    """A group of topics, of vectors where they do not say."""
    rows = [{"topic": each, "type": VECTOR} if isinstance(each, str) else each for each in topics]
    return {"policy": policy, **keys, "topics": rows}


def row(topic: str, **keys: Any) -> dict[str, Any]:
    """An input of vectors, with more to say."""
    return {"topic": topic, "type": VECTOR, **keys}


PAIR: Final = {"front": group("/a", "/b")}
