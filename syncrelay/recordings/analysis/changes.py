"""Better values, put into the text of a file: comments and the order of keys stay."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from io import StringIO
from typing import Any, Final

from ruamel.yaml import YAML

from syncrelay.config import ConfigError, load_text
from syncrelay.config.file import file_format
from syncrelay.config.load import spelt_out
from syncrelay.errors import BagError

_POLICY: Final = "policy"
_WIDEST: Final = 10_000


@dataclass(frozen=True, slots=True)
class Change:
    """A key of a group, or of one of its topics by index, its better value as it stands in a file, and why.

    A key in a mapping of the group has the name of that before it: `transforms.wait`.
    """

    group: str
    topic: int | None
    key: str
    value: str | int
    reason: str


def with_changes(text: str, changes: Sequence[Change]) -> str:
    """Return the text of a file with changes made. What they change may be of other groups too, by anchors.

    A new policy takes keys with it that it does not have.
    """

    def change_all(document: Any) -> None:
        for change in changes:
            group = document["groups"][change.group]
            if change.key == _POLICY:
                _fit(group, str(change.value))
            mapping = group if change.topic is None else group["topics"][change.topic]
            *sections, key = change.key.split(".")
            for section in sections:
                if section not in mapping:
                    mapping[section] = deepcopy(document["defaults"][section])
                mapping = mapping[section]
            _set(mapping, key, change)

    return edited(text, change_all)


def file_with_changes(text: str, changes: Sequence[Change]) -> str:
    """Return the text of a file with changes made, and nothing else changed.

    Raises BagError where anchors or merge keys would carry a change into what it is not for.
    """
    wanted = load_text(with_changes(spelt_out(text), changes)).groups
    # ruamel.yaml deletes no merged key, and fails to delete one that is merged elsewhere.
    with suppress(ConfigError, KeyError, IndexError):
        changed = with_changes(text, changes)
        if load_text(changed).groups == wanted:
            return changed
    raise BagError(
        "the file shares values by anchors or merge keys, so the suggested ones cannot be written for one group alone:"
        " write them by hand"
    )


def with_evidence(text: str, group: str, evidence: Sequence[str]) -> str:
    """Return the text of a file with a comment at each topic of a group."""

    def comment_all(document: Any) -> None:
        for topic, comment in zip(document["groups"][group]["topics"], evidence, strict=True):
            _comment(topic, "topic", comment)

    return edited(text, comment_all)


def patch(changes: Sequence[Change], names: dict[str, Sequence[str]]) -> str:
    """Return changes alone, as the part of a file that they stand in; `names` are the topics of each group."""
    groups: dict[str, Any] = {}
    for change in changes:
        group = groups.setdefault(change.group, {})
        if change.topic is None:
            *sections, key = change.key.split(".")
            for section in sections:
                group = group.setdefault(section, {})
            group[key] = change.value
        else:
            topics = group.setdefault("topics", {})
            topics.setdefault(change.topic, {"topic": names[change.group][change.topic]})[change.key] = change.value
    for group in groups.values():
        if "topics" in group:
            # Those keys first that stand first in a file.
            group["topics"] = [each for _, each in sorted(group.pop("topics").items())]
    return _dumped(_editor(), {"groups": groups})


def _set(mapping: Any, key: str, change: Change) -> None:
    own = [each for each, _ in mapping.non_merged_items()]
    if key not in own and "topics" in own:
        mapping.insert(own.index("topics") + bool(mapping.merge), key, change.value)
    mapping[key] = change.value
    _comment(mapping, key, change.reason)


def _comment(mapping: Any, key: str, comment: str) -> None:
    # Behind a key in braces a comment would swallow the rest of the line.
    if comment and key not in mapping.ca.items and not mapping.fa.flow_style():
        mapping.yaml_add_eol_comment(comment, key, column=0)
        # ruamel.yaml puts one space before it, and linters of YAML ask for two.
        mapping.ca.items[key][2].value = f" # {comment}"


def _fit(group: Any, policy: str) -> None:
    form = file_format()
    for key in [key for key in group if key not in form.groups[policy].model_fields]:
        del group[key]
    for topic in group["topics"]:
        for key in [key for key in topic if key not in form.topics[policy].model_fields]:
            del topic[key]


def edited(text: str, edit: Callable[[Any], None]) -> str:
    """Return the text of a file as an edit of its mappings leaves it: with its comments, and its line breaks."""
    yaml = _editor()
    # Of comments alone it would keep the CR.
    document = yaml.load(text.replace("\r\n", "\n"))
    edit(document)
    written = _dumped(yaml, document)
    return written.replace("\n", "\r\n") if "\r\n" in text else written


def _editor() -> YAML:
    yaml = YAML()
    yaml.preserve_quotes = True
    yaml.width = _WIDEST
    yaml.indent(mapping=2, sequence=4, offset=2)
    return yaml


def _dumped(yaml: YAML, document: Any) -> str:
    out = StringIO()
    yaml.dump(document, out)
    return out.getvalue()
