"""What errors of the relay's file are told by: which model's keys stand where, and what each place is called."""

from collections.abc import Iterator
from typing import Final

from pydantic import BaseModel

from syncrelay.config.export import ExportKeys, LerobotKeys, TaskTopic
from syncrelay.config.file import file_format
from syncrelay.config.models import StampField
from syncrelay.config.problems import Path
from syncrelay.config.qos import QosOverrides
from syncrelay.config.sections import DiagnosticsConfig, MetricsConfig, NodeConfig
from syncrelay.config.translate import Location
from syncrelay.config.wording import all_of, one_of

_SECTIONS: Final[dict[str, type[BaseModel]]] = {
    "node": NodeConfig,
    "metrics": MetricsConfig,
    "diagnostics": DiagnosticsConfig,
    "export": ExportKeys,
}
_BELOW_EXPORT: Final[dict[Location, type[BaseModel]]] = {
    ("export", "lerobot"): LerobotKeys,
    ("export", "lerobot", "task", "<mapping>"): TaskTopic,
}
_WHAT_IS_MISSING: Final = {
    "groups": "expected one group or more",
    "topics": "expected a list of 2 or more topics",
    "version": "expected `version: 1`",
}


class RelayForm:
    """The relay's file; see Form."""

    def path(self, loc: Location) -> Path:
        """Return the path of a place of pydantic's, which has tags too: at a group, and below `qos` and `stamp`."""
        return path_of(loc)

    def model(self, loc: Location) -> type[BaseModel]:
        """See Form."""
        form = file_format()
        match loc:
            case (*_, "qos", "<mapping>"):
                return QosOverrides
            case (*_, "stamp", "<mapping>"):
                return StampField
            case ("groups", _, _, "topics", _):
                return form.topics.get(_policy(loc), form.any_topic)
            case ("groups", _, _):
                return form.group(_policy(loc))
            case (str(key),):
                return _SECTIONS.get(key, form.defaults)
            case _:
                return _BELOW_EXPORT.get(loc, form.file)

    def levels(self) -> Iterator[tuple[str, type[BaseModel]]]:
        """See Form."""
        form = file_format()
        yield "the file", form.file
        yield from ((f"`{key}`", model) for key, model in _SECTIONS.items())
        yield "`export.lerobot`", LerobotKeys
        yield "a group", form.any_group
        yield "a topic", form.any_topic
        yield "a topic's `qos`", QosOverrides

    def owners(self, loc: Location) -> str | None:
        """Name the policies that have a key which the group's own lacks."""
        key, model, form = str(loc[-1]), self.model(loc[:-1]), file_format()
        for models in (form.groups, form.topics):
            if models.get(_policy(loc)) is not model:
                continue
            owners = [policy for policy, other in models.items() if key in other.model_fields]
            if owners:
                return f"{_policy(loc)} has no `{key}`, only {all_of(owners)} {'does' if len(owners) == 1 else 'do'}"
        return None

    def missing(self, loc: Location) -> str:
        """See Form."""
        key, policies = str(loc[-1]), file_format().groups
        if loc[3:] == ("policy",):
            return f"expected {one_of(policies)}"
        if key in _WHAT_IS_MISSING:
            return _WHAT_IS_MISSING[key]
        model = self.model(loc[:-1])
        example = (model.model_fields[key].examples or [""])[0]
        needs = f"{_policy(loc)} needs it, " if model in policies.values() else ""
        return f"{needs}for example `{key}: {example}`"


def _policy(loc: Location) -> str:
    """Return the tag of the group's model, which is its policy's name; nothing outside of groups."""
    return str(loc[2]).strip("<>") if loc[0] == "groups" else ""


def path_of(loc: Location) -> Path:
    """Return the path of a place of pydantic's, which has tags too: at a group, and below keys of several forms."""
    match loc:
        case ("groups", name, _, "topics", index, ("qos" | "stamp") as key, _, *rest):
            return ("groups", name, "topics", index, key, *rest)
        case ("groups", name, _, *rest):
            return ("groups", name, *rest)
        case ("export", "lerobot", "features", name, _, *rest):
            return ("export", "lerobot", "features", name, *rest)
        case ("export", "lerobot", "task", _, *rest):
            return ("export", "lerobot", "task", *rest)
        case _:
            return loc
