"""`defaults`: keys that groups have without writing them."""

from dataclasses import replace

from syncrelay.config.document import MOST_VALUES, Document, Entry, MappingNode, ScalarNode
from syncrelay.config.errors import ConfigError
from syncrelay.config.file import GROUP_MODEL_OF, GroupOfAnyPolicy


def with_defaults(document: Document) -> Document:
    """Return the document with the keys of `defaults` in every group that is silent and whose policy has them.

    The keys keep their place, so a fault in one is shown where it was written. Raises ConfigError where they come to
    more than can be looked at.
    """
    root, defaults, groups = document.root, document.find(("defaults",)), document.find(("groups",))
    if not (isinstance(root, MappingNode) and isinstance(defaults, MappingNode) and isinstance(groups, MappingNode)):
        return document
    filled = MappingNode(
        groups.span,
        {
            name: Entry(group.key, _filled(group.value, defaults)) if isinstance(group.value, MappingNode) else group
            for name, group in groups.entries.items()
        },
    )
    if sum(group.value.size for group in filled.entries.values()) > MOST_VALUES:
        text = f"filled into every group they make over {MOST_VALUES} values"
        raise ConfigError([document.problem(("defaults",), text, code="yaml", span=document.key_span(("defaults",)))])
    entries = root.entries | {"groups": Entry(root.entries["groups"].key, filled)}
    return replace(document, root=MappingNode(root.span, entries))


def _filled(group: MappingNode, defaults: MappingNode) -> MappingNode:
    policy = (group.entries.get("policy") or defaults.entries.get("policy") or (None, None))[1]
    name = policy.value if isinstance(policy, ScalarNode) else None
    model = GROUP_MODEL_OF.get(str(name), GroupOfAnyPolicy)
    own = {
        key: entry
        for key, entry in defaults.entries.items()
        if key in model.model_fields and key != "topics" and key not in group.entries
    }
    return MappingNode(group.span, own | group.entries, group.size + sum(entry.value.size for entry in own.values()))
