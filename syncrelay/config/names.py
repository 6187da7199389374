"""The syntax of names: topics, nodes and namespaces as rcl and rmw check them, message types and fields.

The rules are those of rcl_validate_topic_name and rmw_validate_full_topic_name.
"""

import re
from typing import Final

from syncrelay.config.wording import describe, quoted

# RMW_TOPIC_MAX_NAME_LENGTH and RMW_NODE_NAME_MAX_NAME_LENGTH.
LONGEST_TOPIC: Final = 247
_LONGEST_NODE: Final = 255
_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_NOT_ALLOWED = re.compile(r"[^A-Za-z0-9_/]")
_FULL: Final = re.compile(r"[A-Za-z]\w*/(msg|srv|action)/[A-Za-z]\w*", re.ASCII)
_SHORT: Final = re.compile(r"([A-Za-z]\w*)/([A-Za-z]\w*)", re.ASCII)
# As Python and C++ write it.
_FOREIGN: Final = re.compile(r"([A-Za-z]\w*)(?:\.|::)msg(?:\.|::)([A-Za-z]\w*)", re.ASCII)
_PATH: Final = re.compile(r"[A-Za-z]\w*(\.[A-Za-z]\w*)*", re.ASCII)
_KINDS: Final = {"srv": "a service", "action": "an action"}


def check_topic_name(name: object) -> str:
    """Return a topic name, absolute, relative or private (`~/`); raises ValueError saying what is wrong."""
    if not isinstance(name, str):
        raise ValueError(f"expected a topic name such as /camera/image_raw, found {describe(name)}")  # noqa: TRY004
    if not name:
        raise ValueError("a topic name is empty")
    _check_name(name, kind="topic name")
    return name


def is_topic_name(name: str) -> bool:
    """Return whether ROS accepts a topic name. Recordings and DDS programs may have others."""
    try:
        check_topic_name(name)
    except ValueError:
        return False
    return True


def check_namespace(name: str) -> str:
    """Return a node's namespace, empty or `/` for the root; raises ValueError saying what is wrong."""
    if name not in ("", "/"):
        _check_tokens(name.removeprefix("/"), whole=name, kind="namespace")
    return name


def check_output_prefix(prefix: str) -> str:
    """Return what default output names begin with; raises ValueError saying what is wrong."""
    if prefix not in ("", "/", "~"):
        _check_name(prefix, kind="prefix of topic names")
    return prefix


def check_node_name(name: str) -> str:
    """Return a node's name; raises ValueError saying what is wrong."""
    if "/" in name:
        raise ValueError(f"a node name has no `/`, found {quoted(name)}; `namespace` is a key of its own")
    _check_tokens(name, whole=name, kind="node name")
    if len(name) > _LONGEST_NODE:
        raise ValueError(f"a node name of {len(name)} characters, at most {_LONGEST_NODE} are allowed")
    return name


def check_group_name(name: str) -> str:
    """Return a group's name: one token of a topic name; raises ValueError saying what is wrong."""
    if "$" in name:
        raise ValueError(f"variables work in values only, found {quoted(name)}")
    if not _TOKEN.fullmatch(name):
        raise ValueError(
            f"a group name may have only letters, digits and `_`, and no digit first, found {quoted(name)}:"
            " it becomes part of topic names"
        )
    return name


def expand(name: str, *, node: str, namespace: str) -> str:
    """Return the absolute name that a node gives to a topic, before any remapping."""
    root = namespace.strip("/")
    if name.startswith("/"):
        return name
    if name.startswith("~"):
        return "/" + "/".join(part for part in (root, node, name[1:].strip("/")) if part)
    return f"/{root}/{name}" if root else f"/{name}"


def default_output(topic: str, *, group: str, prefix: str | None) -> str:
    """Return the output name of an input: the prefix, then the input's name.

    Without a prefix it is the group's name, below the root, the namespace or the node, as the input's is: so two robots
    that run one file in namespaces of their own do not publish on the same topics.
    """
    root = next((each for each in ("~/", "/") if topic.startswith(each)), "")
    name = topic.removeprefix(root)
    if prefix is None:
        return f"{root}{group}/{name}"
    return f"{prefix.rstrip('/')}/{name}" if prefix else topic


def _check_tokens(tokens: str, *, whole: str, kind: str) -> None:
    unallowed = _NOT_ALLOWED.search(tokens)
    if unallowed is not None:
        raise ValueError(
            f"a {kind} may have only letters, digits, `_` and `/`, found {quoted(unallowed.group())} in {quoted(whole)}"
        )
    for token in tokens.split("/"):
        if not token:
            raise ValueError(f"a {kind} has one `/` between its parts and none at the end, found {quoted(whole)}")
        if token[0].isdigit():
            raise ValueError(f"no part of a {kind} may begin with a digit, found {quoted(token)} in {quoted(whole)}")


def _check_name(name: str, *, kind: str) -> None:
    if "{" in name or "}" in name:
        raise ValueError(
            f"{quoted(name)}: substitutions such as {{ns}} do not work here, write a relative name instead"
        )
    if name.startswith("~") and not name.startswith("~/"):
        raise ValueError(f"{quoted(name)}: `~` stands for the node's own name and is followed by `/`, as in ~/points")
    _check_tokens(name.removeprefix("~/" if name.startswith("~") else "/"), whole=name, kind=kind)
    if len(name) > LONGEST_TOPIC:
        raise ValueError(f"a {kind} of {len(name)} characters, at most {LONGEST_TOPIC} are allowed")


def check_type_name(name: object) -> str:
    """Return a type's name if it has the form of a message's; raises ValueError saying what is wrong."""
    if not isinstance(name, str):
        raise ValueError(f"expected a message type such as sensor_msgs/msg/Image, found {describe(name)}")  # noqa: TRY004
    full = _FULL.fullmatch(name)
    if full is not None:
        kind = _KINDS.get(full[1])
        if kind is None:
            return name
        raise ValueError(f"{quoted(name)} is {kind} type, expected a message type (package/msg/Name)")
    other = _SHORT.fullmatch(name) or _FOREIGN.fullmatch(name)
    if other is not None:
        raise ValueError(f"{quoted(name)} is not the full name, write `{other[1]}/msg/{other[2]}`")
    raise ValueError(f"{quoted(name)} is not a message type, expected package/msg/Name such as sensor_msgs/msg/Image")


def check_frame(frame: str) -> str:
    """Return a coordinate frame if tf2 can look it up; raises ValueError saying what is wrong."""
    if not frame:
        raise ValueError("a frame's name is empty")
    if frame.startswith("/"):
        raise ValueError(
            f"tf2 looks up no frame that begins with `/`: write {quoted(frame.lstrip('/') or 'base_link')}"
        )
    return frame


def check_field_path(path: str) -> str:
    """Return a path of fields if it has the form of one; raises ValueError saying what is wrong."""
    if not _PATH.fullmatch(path):
        raise ValueError(f"expected names of fields joined by dots, such as header.stamp, found {describe(path)}")
    return path
