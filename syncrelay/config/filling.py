"""`defaults`: keys that groups have without writing them."""

from dataclasses import replace

from syncrelay.config.document import Document, Entry, MappingNode, ScalarNode
from syncrelay.config.file import GROUP_MODEL_OF, GroupOfAnyPolicy


def with_defaults(document: Document) -> Document:
    """Return the document with the keys of `defaults` in every group that is silent and whose policy has them.

    The keys keep their place, so a fault in one is shown where it was written.
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
    entries = root.entries | {"groups": Entry(root.entries["groups"].key, filled)}
    return replace(document, root=MappingNode(root.span, entries))


def _filled(group: MappingNode, defaults: MappingNode) -> MappingNode:
    policy = (group.entries.get("policy") or defaults.entries.get("policy") or (None, None))[1]
    name = policy.value if isinstance(policy, ScalarNode) else None
    model = GROUP_MODEL_OF.get(str(name), GroupOfAnyPolicy)
    own = {key: entry for key, entry in defaults.entries.items() if key in model.model_fields and key != "topics"}
    return MappingNode(group.span, own | group.entries)
