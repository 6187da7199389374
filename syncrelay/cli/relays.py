"""The relays that a command speaks to: all that answer, or the one that is meant."""

from collections.abc import Sequence

from syncrelay.errors import SyncRelayError
from syncrelay.top.client import Answer, Search, base_urls, search


def find(named: str | None, *, otherwise: str) -> tuple[Answer, ...]:
    """Return the relays of this machine, or those at the host, host:port or URL that is named; one or more.

    Raises SyncRelayError where none answers, with what to do `otherwise`, and UsageError for a name that is none.
    """
    found = search(base_urls(named))
    if not found.relays:
        where = "on this machine" if named is None else f"at {named}"
        raise SyncRelayError(f"no relay answers {where}{_others(found)}\n{otherwise}")
    return found.relays


def find_one(named: str | None, *, otherwise: str) -> Answer:
    """Return the only relay there is; as `find`. Raises SyncRelayError where there are several, with their URLs."""
    found = find(named, otherwise=otherwise)
    if len(found) > 1:
        raise SyncRelayError(_several(found))
    return found[0]


def otherwise(named: str | None) -> str:
    """Say what to do where no relay answers."""
    if named is None:
        return (
            "  Start one with `syncrelay --config FILE` (not with `metrics: null` in it),\n"
            "  or say where it is: `--url robot:9464`."
        )
    return (
        "  A relay on another machine answers only if its file says\n"
        "  `metrics: {listen: 0.0.0.0:9464}` and no firewall is in between."
    )


def _others(found: Search) -> str:
    # Of a machine whose name is not known, or that is off, all ports say the same.
    reasons = {text.partition(": ")[2]: text for text in reversed(found.others)}
    return "".join(f"\n  {text}" for text in reversed(reasons.values()))


def _several(relays: Sequence[Answer]) -> str:
    lines = "".join(
        f"\n  --url {each.url}   {each.status.relay.node}: {', '.join(group.name for group in each.status.groups)}"
        for each in relays
    )
    return f"{len(relays)} relays answer; choose one{lines}"
