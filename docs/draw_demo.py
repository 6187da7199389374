"""Draws docs/demo.svg from a real run of the demo: `python docs/draw_demo.py`."""  # noqa: INP001  no package

from pathlib import Path

from picture import COLUMNS, LINES, draw

from syncrelay.cli.demo import prepare_ros, relay_rig
from syncrelay.cli.live import Moment, frame
from syncrelay.cli.stop import StopRequest
from syncrelay.explain import RecentDrop
from syncrelay.top.strip import Sweep, newest_stamp

_STRIP = 65
_SECONDS = 16.0
_SETTLED_S = 8.0
_PICTURE = Path(__file__).parent / "demo.svg"


def main() -> None:
    """Run the demo and draw the moment that shows most."""
    prepare_ros()
    moments: list[Moment] = []
    relay_rig(moments.append, total_s=_SECONDS, seed=0, stop=StopRequest())
    best = max((moment for moment in moments if moment.elapsed_s > _SETTLED_S), key=_fullness)
    draw(frame(best, width=COLUMNS, height=LINES), _PICTURE)


def _fullness(moment: Moment) -> tuple[bool, int]:
    """Prefer a moment that shows a lost set, and then one at which the sweep is about to begin again."""
    states = tuple(figures.state for figures in moment.groups)
    sweep = Sweep(head=newest_stamp(outcome for state in states for outcome in state.recent), width=_STRIP)
    lidar = next(index for index, each in enumerate(states[0].inputs) if "lidar" in each.topic)
    lost = [one for one in states[0].recent if isinstance(one, RecentDrop) and one.input == lidar]
    return any(sweep.column(one.stamp) for one in lost), sweep.column(sweep.head) or 0


if __name__ == "__main__":
    main()
