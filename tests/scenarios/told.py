"""What a relay told of a group, for assertions and for whoever reads that one failed."""

from collections.abc import Collection

from tests.scenarios.play import Line, Played

# What a machine that gives a relay too little time makes of it, truly: no test has a say in that.
_BUSY = {"too_slow"}
# A machine that leaves a well rig's sets waiting for longer than this holds up all others as well.
_BUSY_MS = 40


def false_warnings(played: Played, name: str, allowed: Collection[str]) -> list[Line]:
    return [line for line in played.warnings_of(name) if line.finding not in _BUSY | set(allowed)]


def was_busy(played: Played, well: str) -> bool:
    """Whether the machine held a rig up at last that is well."""
    return bool(played.last[well]["latency_ms"]["p95"] > _BUSY_MS)


def told(played: Played, name: str) -> str:
    """All that was said of a group, in lines."""
    said = [f"act {line.act}: [{line.finding}] {line.message}" for line in played.warnings_of(name)]
    shown = [f"act {act}: /status showed {', '.join(codes)}" for act, codes in played.shown.get(name, {}).items()]
    last = [f"at last: [{each['code']}] {each['text']}" for each in played.last.get(name, {}).get("findings", [])]
    return "\n".join([name, *said, *shown, *last, f"written: {played.written.get(name)}"])
