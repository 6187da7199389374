"""The model of the whole file for the installed policies, and a lenient one for files with faults."""

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from functools import cache, partial, reduce
from operator import or_
from types import GenericAlias
from typing import Annotated, Any, Final, Literal, TypeVar

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, create_model
from pydantic.fields import FieldInfo

from syncrelay.config.bundle import BundleKeys
from syncrelay.config.export import ExportKeys, LerobotKeys
from syncrelay.config.installed import NOT_SHARED, Policies, installed_policies, shared_keys, topic_model
from syncrelay.config.keys import NOT_NULL, Keys
from syncrelay.config.models import Group, Topic, Topics
from syncrelay.config.names import check_group_name
from syncrelay.config.qos import QosOverrides
from syncrelay.config.sections import DiagnosticsConfig, MetricsConfig, NodeConfig
from syncrelay.config.translate import Form
from syncrelay.config.wording import describe, one_of

AnyKeys = TypeVar("AnyKeys", bound=Keys)


def _version(value: Any) -> Any:
    """Accept the integer 1 alone: in Python `True` and 1.0 equal it."""
    if type(value) is not int or value != 1:
        raise ValueError(f"expected 1, the version of the format, found {describe(value)}")
    return value


Version = Annotated[Literal[1], BeforeValidator(_version)]
"""The version of the format of a file."""


class FileKeys(Keys):
    """A syncrelay file: which topics are matched by time, and where the matched messages go."""

    version: Version = Field(description="Version of this format: 1.")
    node: NodeConfig = Field(default_factory=NodeConfig, description="The ROS node.")
    metrics: MetricsConfig | None = Field(
        default_factory=MetricsConfig,
        description="HTTP server for status and metrics, null for none.",
        json_schema_extra={"nullable": True},
    )
    diagnostics: DiagnosticsConfig | None = Field(
        default_factory=DiagnosticsConfig,
        description="What the relay publishes about itself, null for nothing.",
        json_schema_extra={"nullable": True},
    )
    export: Annotated[ExportKeys | None, NOT_NULL] = Field(
        default=None, description="What `syncrelay export` makes of the sets. Default: nothing but tables."
    )
    defaults: Keys | None = None
    groups: dict[str, Group]


@dataclass(frozen=True, slots=True)
class FileFormat:
    """The models of a file. `groups` has those of groups by policy, `topics` those of their topics.

    `any_group` and `any_topic` have the keys of all policies, for a group whose policy is missing or misspelt.
    `defaults` has every key of a group but its topics.
    """

    groups: dict[str, type[Group]]
    topics: dict[str, type[Topic]]
    any_group: type[Group]
    any_topic: type[Topic]
    defaults: type[Keys]
    file: type[FileKeys]

    def group(self, policy: object) -> type[Group]:
        """Return the model of a policy's groups; for an unknown policy, the model with the keys of all."""
        return self.groups.get(policy, self.any_group) if isinstance(policy, str) else self.any_group


def file_format() -> FileFormat:
    """Return the models of a file with all policies that are installed."""
    return _format_of(installed_policies())


def partial_format() -> type[FileKeys]:
    """Return the model of a file in which no key is needed."""
    return _partial_format_of(installed_policies())


@cache
def _format_of(installed: Policies) -> FileFormat:
    groups = dict(installed.models)
    topics = {policy: topic_model(model) for policy, model in groups.items()}
    names: Any = Annotated[Literal[tuple(groups)], BeforeValidator(partial(_refuse_policy, installed.refused))]
    every_key = shared_keys((Group, *groups.values()))
    keys: dict[str, Any] = {name: _loose(every_key[name], None) for name in every_key if name not in NOT_SHARED}
    about = "How the messages of a group are matched."
    any_topic = create_model("TopicOfAnyPolicy", __base__=Topic, **_fields(shared_keys((Topic, *topics.values()))))
    any_group = create_model(
        "GroupOfAnyPolicy",
        __base__=Group,
        policy=(names, Field(description=about)),
        topics=(_tuple_of(any_topic), Topics),
        **{name: key for name, key in keys.items() if name not in Group.model_fields},
    )
    defaults = create_model(
        "Defaults",
        __base__=Keys,
        __doc__="Keys for all groups. What a group's policy does not have is ignored there.",
        policy=(names, Field(default=None, description=about)),
        **keys,
    )
    return FileFormat(groups, topics, any_group, any_topic, defaults, _file(defaults, _by_policy(groups, any_group)))


def _refuse_policy(refused: Mapping[str, str], name: Any) -> Any:
    if isinstance(name, str) and name in refused:
        raise ValueError(refused[name])
    return name


def _file(defaults: type[Keys], group: Any) -> type[FileKeys]:
    about_defaults = (
        "Keys for all groups, where a group does not have its own. A key that a group's policy does not have is"
        " ignored there; one that no policy has is an error."
    )
    about_groups: Any = Field(
        description="Groups by name, 1 or more. The name stands in the log and in the names of outputs.",
        json_schema_extra={"minProperties": 1, "propertyNames": {"pattern": "^[A-Za-z_][A-Za-z0-9_]*$"}},
    )
    return create_model(
        "File",
        __base__=FileKeys,
        __doc__=FileKeys.__doc__,
        defaults=(defaults, Field(default=None, description=about_defaults)),
        groups=(_dict_of(Annotated[str, AfterValidator(check_group_name)], group), about_groups),
    )


def _fields(keys: Mapping[str, FieldInfo]) -> dict[str, Any]:
    return {name: (info.annotation, info) for name, info in keys.items()}


def _loose(info: FieldInfo, default: Any) -> tuple[Any, FieldInfo]:
    loose = copy(info)
    loose.default = default
    return info.annotation, loose


def _dict_of(key: Any, value: Any) -> Any:
    return GenericAlias(dict, (key, value))


def _tuple_of(model: type[Topic]) -> Any:
    return GenericAlias(tuple, (model, ...))


def _by_policy(groups: Mapping[str, type[Group]], any_group: type[Group]) -> Any:
    """Return the union of groups, in which the policy chooses."""

    def tag(value: Any) -> str:
        policy = value.get("policy") if isinstance(value, dict) else None
        return f"<{policy}>" if isinstance(policy, str) and policy in groups else "<any>"

    tagged = [*((model, f"<{name}>") for name, model in groups.items()), (any_group, "<any>")]
    branches: list[Any] = [Annotated[model, Tag(name)] for model, name in tagged]
    return Annotated[reduce(or_, branches), Discriminator(tag)]


# The value of a required key that is missing or faulty; of all others it is None.
_UNKNOWN: Final[Mapping[str, Any]] = {"topic": "", "features": {}}


def _partial(model: type[AnyKeys], **fields: Any) -> type[AnyKeys]:
    """Return a model of which every key may be missing."""
    needed = {name: info for name, info in model.model_fields.items() if info.is_required() and name not in fields}
    loose: dict[str, Any] = {name: _loose(info, _UNKNOWN.get(name)) for name, info in needed.items()}
    return create_model(f"Partial{model.__name__}", __base__=model, **(loose | fields))


@cache
def _partial_format_of(installed: Policies) -> type[FileKeys]:
    form = _format_of(installed)
    by_policy = {policy: _partial_group(model) for policy, model in form.groups.items()}
    group = _by_policy(by_policy, _partial_group(form.any_group))
    export = _partial(ExportKeys, lerobot=(_partial(LerobotKeys) | None, None)) | None
    return _partial(FileKeys, defaults=(Any, None), groups=(_dict_of(str, group), {}), export=(export, None))


def _partial_group(model: type[Group]) -> type[Group]:
    return _partial(model, topics=(_tuple_of(_partial(topic_model(model))), ()))


def relay_form() -> Form:
    """Return what the errors of the relay's file are translated by."""
    known = file_format()
    return Form(
        known.file,
        levels={
            "the file": known.file,
            "`node`": NodeConfig,
            "`metrics`": MetricsConfig,
            "`diagnostics`": DiagnosticsConfig,
            "`export`": ExportKeys,
            "`export.lerobot`": LerobotKeys,
            "a group": known.any_group,
            "a topic": known.any_topic,
            "a topic's `qos`": QosOverrides,
            "`bundle`": BundleKeys,
        },
        missing={
            "groups": "expected one group or more",
            "topics": "expected a list of 2 or more topics",
            "version": "expected `version: 1`",
            "policy": f"expected {one_of(known.groups)}",
        },
        kinds=(known.groups, known.topics),
    )
