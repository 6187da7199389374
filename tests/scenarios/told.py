"""What a relay told of a group, for assertions and for whoever reads that one failed."""

from collections.abc import Collection

from tests.scenarios.play import Line, Played

# What a machine that gives a relay too little time makes of it, truly: no test has a say in that.
_BUSY = {"too_slow"}


def false_warnings(played: Played, name: str, allowed: Collection[str]) -> list[Line]:
    return [line for line in played.warnings_of(name) if line.finding not in _BUSY | set(allowed)]


def told(played: Played, name: str) -> str:
    """All that was said of a group, in lines."""
    said = [f"act {line.act}: [{line.finding}] {line.message}" for line in played.warnings_of(name)]
    shown = [f"act {act}: /status showed {', '.join(codes)}" for act, codes in played.shown.get(name, {}).items()]
    last = [f"at last: [{each['code']}] {each['text']}" for each in played.last.get(name, {}).get("findings", [])]
    return "\n".join([name, *said, *shown, *last, f"written: {played.written.get(name)}"])
