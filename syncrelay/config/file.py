"""The whole file as a model, and the loosest form of a group, which has the keys of every policy."""

from collections.abc import Iterable
from copy import copy
from functools import reduce
from operator import or_
from types import GenericAlias
from typing import Annotated, Any, Final, Literal, get_args

from pydantic import AfterValidator, BaseModel, BeforeValidator, Discriminator, Field, Tag, create_model
from pydantic.fields import FieldInfo

from syncrelay.config.keys import Keys
from syncrelay.config.models import DiagnosticsConfig, MetricsConfig, NodeConfig, Topic
from syncrelay.config.names import check_group_name
from syncrelay.config.policies import GROUP_MODELS, AnyGroup, Topics
from syncrelay.config.wording import describe

GROUP_MODEL_OF: Final[dict[str, type[AnyGroup]]] = {
    get_args(model.model_fields["policy"].annotation)[0]: model for model in GROUP_MODELS
}
"""The model of each policy by the policy's name."""


def topic_model(group: type[AnyGroup]) -> type[Topic]:
    """Return the model of a group's topics."""
    model: type[Topic] = get_args(group.model_fields["topics"].annotation)[0]
    return model


def _every_key(models: Iterable[type[BaseModel]]) -> dict[str, tuple[Any, FieldInfo]]:
    return {name: (info.annotation, info) for model in models for name, info in model.model_fields.items()}


def _optional(annotation: Any, info: FieldInfo) -> tuple[Any, FieldInfo]:
    loose = copy(info)
    loose.default = None
    return annotation, loose


_POLICY: Final = "How the messages of a group are matched."
_PolicyName: Any = Literal[tuple(GROUP_MODEL_OF)]
_GROUP_KEYS: Final[dict[str, Any]] = {
    name: _optional(*key) for name, key in _every_key(GROUP_MODELS).items() if name not in ("policy", "topics")
}
_TOPIC_KEYS: Final[dict[str, Any]] = dict(_every_key(topic_model(group) for group in GROUP_MODELS))

TopicOfAnyPolicy: Final = create_model("TopicOfAnyPolicy", __base__=Keys, **_TOPIC_KEYS)
"""A topic with the keys of every policy."""
_TopicsOfAnyPolicy: Any = GenericAlias(tuple, (TopicOfAnyPolicy, ...))

GroupOfAnyPolicy: Final = create_model(
    "GroupOfAnyPolicy",
    __base__=Keys,
    policy=(_PolicyName, Field(description=_POLICY)),
    topics=(_TopicsOfAnyPolicy, Topics),
    **_GROUP_KEYS,
)
"""A group whose policy is missing or misspelt: its other keys are checked all the same."""

Defaults: Final = create_model(
    "Defaults",
    __base__=Keys,
    __doc__="Keys of a group, used where a group is silent. What a group's policy does not have is passed over.",
    policy=(_PolicyName, Field(default=None, description=_POLICY)),
    **_GROUP_KEYS,
)
"""Every key of a group but its topics, all optional."""


def _tag_of_group(value: Any) -> str:
    policy = value.get("policy") if isinstance(value, dict) else None
    return f"<{policy}>" if isinstance(policy, str) and policy in GROUP_MODEL_OF else "<any>"


_BRANCHES: Final[tuple[Any, ...]] = (
    *(Annotated[model, Tag(f"<{name}>")] for name, model in GROUP_MODEL_OF.items()),
    Annotated[GroupOfAnyPolicy, Tag("<any>")],
)
_Group: Any = Annotated[reduce(or_, _BRANCHES), Discriminator(_tag_of_group)]
_Groups: Any = GenericAlias(dict, (Annotated[str, AfterValidator(check_group_name)], _Group))


def _version(value: Any) -> Any:
    """Return 1; to Python `true` and 1.0 are that too."""
    if type(value) is not int or value != 1:
        raise ValueError(f"expected 1, the version of the format, found {describe(value)}")
    return value


class FileKeys(Keys):
    """A syncrelay file: which topics are matched by time, and where the matched messages go."""

    version: Annotated[Literal[1], BeforeValidator(_version)] = Field(description="Version of this format: 1.")
    node: NodeConfig = Field(default_factory=NodeConfig, description="The ROS node.")
    metrics: MetricsConfig | None = Field(
        default_factory=MetricsConfig,
        description="HTTP for programs and people, null for none.",
        json_schema_extra={"nullable": True},
    )
    diagnostics: DiagnosticsConfig | None = Field(
        default_factory=DiagnosticsConfig,
        description="What is published about the relay, null for nothing.",
        json_schema_extra={"nullable": True},
    )
    defaults: Keys | None = None
    groups: dict[str, AnyGroup]


File: Final = create_model(
    "File",
    __base__=FileKeys,
    __doc__=FileKeys.__doc__,
    defaults=(
        Defaults,
        Field(
            default=None,
            description=(
                "Keys of a group, used where a group is silent. A key that the group's policy does not have is"
                " passed over there; one that no policy has is an error."
            ),
        ),
    ),
    groups=(
        _Groups,
        Field(
            description=("Groups by name, 1 or more. The name stands in the log and in the names of outputs."),
            json_schema_extra={"minProperties": 1, "propertyNames": {"pattern": "^[A-Za-z_][A-Za-z0-9_]*$"}},
        ),
    ),
)
"""FileKeys with the group's model chosen by its policy."""
