"""What a reload would do, as lines of text and as JSON."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from syncrelay.config.difference import Difference, Endpoints, GroupChange, KeyChange
from syncrelay.config.wording import all_of, counted


def difference_lines(found: Difference) -> Iterator[str]:
    """Yield what a reload does, in lines."""
    yield _summary(found)
    yield from (f"  {section}" for section in found.sections)
    gone = found.exchange
    if not found.is_empty and not found.restart:
        yield from (f"  {name}: keeps running, loses nothing" for name in gone.kept)
    rebuilt = "changed" if found.restart else "rebuilt; what waits in its queues is dropped"
    for change in found.groups:
        # A restart rebuilds all groups; only those with changed keys get lines.
        if lines := list(_group_lines(change)):
            yield f"~ {change.name}: {rebuilt}"
            yield from (f"    {line}" for line in lines)
    yield from (f"+ {name}: started" for name in gone.started)
    yield from (f"- {name}: ended" for name in gone.ended)
    yield from _endpoint_lines("subscriptions", found.subscriptions)
    yield from _endpoint_lines(
        "publishers", replace(found.publishers, made_again=()) if found.restart else found.publishers
    )


def _summary(found: Difference) -> str:
    gone = found.exchange
    if found.is_empty:
        return f"a reload changes nothing: {counted(len(gone.kept), 'group')} unchanged"
    if found.restart:
        keys = all_of(f"`{key}`" for key in found.restart)
        return f"a reload would be refused: {keys} cannot change while the relay runs; after a restart:"
    done = {"keeps": gone.kept, "rebuilds": gone.rebuilt, "starts": gone.started, "ends": gone.ended}
    return "a reload " + all_of(f"{verb} {counted(len(names), 'group')}" for verb, names in done.items() if names)


def _group_lines(change: GroupChange) -> Iterator[str]:
    yield from map(str, change.keys)
    yield from (f"{topic}: no longer an input" for topic in change.removed)
    yield from (f"{topic}: a new input" for topic in change.added)
    if change.reordered:
        yield "its inputs are in another order"


def _endpoint_lines(title: str, endpoints: Endpoints) -> Iterator[str]:
    if endpoints.lost or endpoints.made or endpoints.made_again:
        yield f"{title}:"
    yield from (f"- {_endpoint(each)}" for each in endpoints.lost)
    yield from (f"+ {_endpoint(each)}" for each in endpoints.made)
    yield from (f"~ {_endpoint(each)}: made again" for each in endpoints.made_again)


def _endpoint(words: Sequence[str]) -> str:
    topic, type_name, *qos = words
    said = [topic, type_name or "(type from the graph)", *(f"qos {each}" for each in qos if each != "auto")]
    return " ".join(said)


def difference_as_json(found: Difference) -> dict[str, Any]:
    """Return what json.dumps takes."""
    gone = found.exchange
    return {
        "reload": "none" if found.is_empty else "refused" if found.restart else "taken",
        "restart": list(found.restart),
        "sections": [_key_as_json(each) for each in found.sections],
        "groups": {
            "kept": list(gone.kept),
            "rebuilt": [_group_as_json(each) for each in found.groups],
            "started": list(gone.started),
            "ended": list(gone.ended),
        },
        "subscriptions": _endpoints_as_json(found.subscriptions),
        "publishers": {
            **_endpoints_as_json(found.publishers),
            "made_again": [_endpoint_as_json(each) for each in found.publishers.made_again],
        },
    }


def _key_as_json(change: KeyChange) -> dict[str, Any]:
    return {"key": change.key, "old": change.old, "new": change.new}


def _group_as_json(change: GroupChange) -> dict[str, Any]:
    return {
        "name": change.name,
        "keys": [{"topic": each.topic, **_key_as_json(each)} for each in change.keys],
        "inputs_removed": list(change.removed),
        "inputs_added": list(change.added),
        "inputs_reordered": change.reordered,
    }


def _endpoints_as_json(endpoints: Endpoints) -> dict[str, Any]:
    told = {"lost": endpoints.lost, "made": endpoints.made}
    return {what: [_endpoint_as_json(each) for each in those] for what, those in told.items()}


def _endpoint_as_json(words: Sequence[str]) -> dict[str, str | None]:
    return {key: word or None for key, word in zip(("topic", "type", "qos"), words, strict=False)}
