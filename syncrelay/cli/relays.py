"""The relays that a command talks to: all that answer, or the one that is named."""

from syncrelay.errors import SyncRelayError
from syncrelay.top.client import Answer, base_urls, search


def find(named: str | None, *, otherwise: str) -> tuple[Answer, ...]:
    """Return the relays of this machine, or those at the host, host:port or URL that is named; at least one.

    Raises SyncRelayError, which ends with the hint `otherwise`, if none answers, and UsageError for a malformed name.
    """
    found = search(base_urls(named))
    if not found.relays:
        where = "on this machine" if named is None else f"at {named}"
        # All ports of a machine that is off or unknown give the same reason, which is said once.
        reasons = {text.partition(": ")[2]: text for text in reversed(found.others)}
        others = "".join(f"\n  {text}" for text in reversed(reasons.values()))
        raise SyncRelayError(f"no relay answers {where}{others}\n{otherwise}")
    return found.relays


def find_one(named: str | None, *, otherwise: str) -> Answer:
    """Return the only relay that `find` finds; raises SyncRelayError with their URLs if there are several."""
    found = find(named, otherwise=otherwise)
    if len(found) > 1:
        lines = "".join(
            f"\n  --url {each.url}   {each.status.relay.node}: {', '.join(group.name for group in each.status.groups)}"
            for each in found
        )
        raise SyncRelayError(f"{len(found)} relays answer; choose one{lines}")
    return found[0]


def otherwise(named: str | None) -> str:
    """Return a hint for where no relay answers."""
    if named is None:
        return (
            "  Start one with `syncrelay --config FILE` (not with `metrics: null` in it),\n"
            "  or say where it is: `--url robot:9464`."
        )
    return (
        "  A relay on another machine answers only if its file says\n"
        "  `metrics: {listen: 0.0.0.0:9464}` and no firewall is in between."
    )
