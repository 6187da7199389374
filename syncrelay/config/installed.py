"""The policies that are installed: those of syncrelay, and those that other packages offer.

A package offers a policy by an entry point of the group `syncrelay.policies`, whose name is the policy's and whose
object is the model of its keys; see docs/howto/own_policy.md. A package that is broken is an error of the files that
use its policy, and of no others.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import EntryPoint, distributions
from typing import Any, Final, get_args

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from syncrelay.config import policies
from syncrelay.config.models import Group, Topic
from syncrelay.config.wording import all_of, quoted

ENTRY_POINTS: Final = "syncrelay.policies"
"""The group of the entry points."""

NOT_SHARED: Final = ("policy", "topics")
"""The keys of a group that each policy has in its own way."""


@dataclass(frozen=True, slots=True, eq=False)
class Policies:
    """The models of all policies by their names, and why those that packages offer are `refused`, by name too."""

    models: Mapping[str, type[Group]]
    refused: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class _Offer:
    """An entry point and its distribution, as `robot-policies 1.2`."""

    entry: EntryPoint
    distribution: str


@cache
def installed_policies() -> Policies:
    """Return all policies, in the order in which people read of them, then by the names of their packages."""
    models = {policy_name(model): model for model in policies.GROUP_MODELS}
    offers: dict[str, list[_Offer]] = {}
    for offer in sorted(_offers(), key=lambda offer: (offer.distribution, offer.entry.name)):
        offers.setdefault(offer.entry.name, []).append(offer)
    refused: dict[str, str] = {}
    for name, those in offers.items():
        packages = all_of(offer.distribution for offer in those)
        if name in models:
            refused[name] = f"{packages} offers a policy of this name too, which is not used: this one is syncrelay's"
        elif len(those) > 1:
            refused[name] = f"the policy {quoted(name)} is offered by {packages}: uninstall all but one of them"
        else:
            try:
                model = those[0].entry.load()
                fault = next(_faults(those[0].entry, model, [*models.values()]), "")
            # Code of others may raise anything, or exit, and files that do without it are none the worse.
            except (Exception, SystemExit) as error:  # noqa: BLE001
                fault = f"{type(error).__name__}: {error}"
            if fault:
                refused[name] = f"the policy {quoted(name)} of {packages} cannot be used: {fault}"
            else:
                models[name] = model
    return Policies(models, refused)


def policy_name(model: type[Group]) -> str:
    """Return the name of a policy in the file."""
    (name,) = get_args(model.model_fields["policy"].annotation)
    return str(name)


def suspects(policy: str) -> str:
    """Return whose code has the bug where a group of this policy fails, for a sentence: "a bug in ..."."""
    own = any(policy_name(model) == policy for model in policies.GROUP_MODELS)
    return "syncrelay" if own else f"syncrelay or in the package of the policy {quoted(policy)}"


def topic_model(group: type[Group]) -> type[Topic]:
    """Return the model of the topics of a policy's groups."""
    model: type[Topic] = get_args(group.model_fields["topics"].annotation)[0]
    return model


def shared_keys(models: Iterable[type[BaseModel]]) -> dict[str, FieldInfo]:
    """Return all keys of some models. Raises TypeError where two have one of the same name and different types.

    `defaults` holds one value for the groups of all policies.
    """
    keys: dict[str, FieldInfo] = {}
    owners: dict[str, str] = {}
    for model in models:
        for name, info in model.model_fields.items():
            key, owner = keys.setdefault(name, info), owners.setdefault(name, model.__name__)
            if name not in NOT_SHARED and (key.annotation, key.metadata) != (info.annotation, info.metadata):
                raise TypeError(
                    f"the key `{name}` of {model.__name__} has another type than that of {owner}: rename one of them,"
                    " as `defaults` holds one value for both"
                )
    return keys


def _offers() -> Iterator[_Offer]:
    """Yield the entry points of all distributions, each distribution once: the first on sys.path hides others."""
    seen: set[str] = set()
    for distribution in distributions():
        # What is installed beside syncrelay may be damaged: such a distribution offers nothing.
        with suppress(Exception):
            # To parse the entry points of them all takes twice as long as to read them: 14 ms in place of 8 for 190.
            if ENTRY_POINTS not in (distribution.read_text("entry_points.txt") or "") or distribution.name in seen:
                continue
            entries = distribution.entry_points.select(group=ENTRY_POINTS)
            offers = [_Offer(entry, f"{distribution.name} {distribution.version}") for entry in entries]
            seen.add(distribution.name)
            yield from offers


def _faults(entry: EntryPoint, model: Any, others: Sequence[type[Group]]) -> Iterator[str]:
    """Yield why what an entry point names cannot stand beside the other policies, beginning with the worst."""
    if not (isinstance(model, type) and issubclass(model, Group)):
        yield f"{entry.value} is no subclass of syncrelay.config.models.Group"
        return
    if get_args(model.model_fields["policy"].annotation) != (entry.name,):
        yield f"`policy` of {entry.value} has to be Literal[{entry.name!r}], as its entry point is called"
    match get_args(model.model_fields["topics"].annotation):
        case (type() as topic, end) if issubclass(topic, Topic) and end is ...:
            pass
        case _:
            yield f"`topics` of {entry.value} has to be a tuple[Topic, ...], or one of a subclass of Topic"
    if model.trigger_key not in (None, *model.model_fields):
        yield f"the trigger_key of {entry.value} is {quoted(str(model.trigger_key))}, which is none of its keys"
    if model.build_policy is Group.build_policy:
        yield f"{entry.value} has no build_policy of its own"
    try:
        shared_keys((Group, *others, model))
        shared_keys((Topic, *map(topic_model, (*others, model))))
    except TypeError as error:
        yield str(error)
    # What pydantic cannot make a schema of raises here, and not at the first file.
    model.model_json_schema()
