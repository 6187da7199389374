"""A healthy group of two inputs at 10 Hz after a minute, to be made ill in one respect."""

from dataclasses import replace

from syncrelay.explain import Distribution, Endpoint, GroupFacts, InputFacts, InputGraph, Tolerance
from syncrelay.explain.figures import GroupFigures, InputFigures
from syncrelay.sync.counts import InputCounts

S = 1_000_000_000
MS = 1_000_000
BEGAN = 1_700_000_000 * S
NOW = BEGAN + 60 * S
IMAGE = "sensor_msgs/msg/Image"


def an_input(name="/camera", *, node="/driver", counts=None, figures=None, **facts):
    """An input at 10 Hz, all of whose messages go into sets; `figures` changes some, of the last messages too."""
    graph = {"name": name, "output": f"/front{name}", "publishers": (Endpoint(node, IMAGE),)}
    graph |= {key: facts.pop(key) for key in InputGraph.__slots__ if key in facts}
    return InputFacts(
        **{
            "graph": InputGraph(**graph),
            "type": IMAGE,
            "required": True,
            "counts": counts or InputCounts(600, 600, {}, 0),
            "figures": _input_figures(**(figures or {})),
            **facts,
        }
    )


def _input_figures(*, last_received=NOW - 50 * MS, longest_pause=101 * MS, delay=5 * MS, **others):
    usual = InputFigures(
        rate_hz=10.0,
        usual_hz=10.0,
        fed=100,
        flows_since=BEGAN,
        received=() if last_received is None else (last_received - longest_pause, last_received),
        delays=() if delay is None else (delay, delay),
    )
    return replace(usual, **others)


def a_group(*inputs, figures=None, **facts):
    """A group whose sets leave at 10 Hz; `figures` changes some."""
    each = inputs or (an_input(), an_input("/lidar"))
    usual = GroupFigures(
        now=NOW,
        began=BEGAN,
        sets=600,
        rate_hz=10.0,
        best_hz=10.0,
        last_set=NOW - 50 * MS,
        spans=Distribution([5 * MS] * 100),
        latencies=Distribution([2 * MS] * 100),
        nearest=Distribution([5 * MS] * 100),
        missing=(0.0,) * len(each),
        sets_since_without=(0,) * len(each),
    )
    return GroupFacts(
        **{
            "name": "front",
            "policy": "approximate_time",
            "queue_size": 10,
            "inputs": each,
            "figures": replace(usual, **(figures or {})),
            "tolerance": Tolerance("slop", 20 * MS),
            **facts,
        }
    )


def a_silent_group(*inputs, figures=None, **facts):
    """The same after seven seconds without a set."""
    left = {"rate_hz": 0.0, "last_set": NOW - 7 * S, "left_at": [NOW - n * S for n in range(60, 6, -1)]}
    return a_group(*inputs, figures={**left, **(figures or {})}, **facts)
