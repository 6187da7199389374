"""Draws docs/demo.svg from a real run of the demo: `python docs/draw_demo.py`."""  # noqa: INP001  no package

from contextlib import nullcontext
from pathlib import Path

from picture import COLUMNS, LINES, draw

from syncrelay.cli.demo import prepare_ros, relay_rig
from syncrelay.cli.stop import StopRequest
from syncrelay.explain import RecentDrop
from syncrelay.top.demo_screen import frame, window_of
from syncrelay.top.group_blocks import as_matched
from syncrelay.top.plain import Moment

_SECONDS = 16.0
_SETTLED_S = 8.0
_LIDAR = 1
_PICTURE = Path(__file__).parent / "demo.svg"


def main() -> None:
    """Run the demo and draw the moment that shows most."""
    prepare_ros()
    moments: list[Moment] = []
    relay_rig(nullcontext(moments.append), total_s=_SECONDS, seed=1, stop=StopRequest())
    settled = [moment for moment in moments if moment.elapsed_s > _SETTLED_S]
    healthy = [moment for moment in settled if not any(group.problems for group in moment.state.groups)]
    draw(frame(max(healthy or settled, key=_shows_a_lost_set), width=COLUMNS, height=LINES), _PICTURE)


def _shows_a_lost_set(moment: Moment) -> bool:
    window = window_of(moment, COLUMNS)
    outcomes = as_matched(moment.state.groups[0])
    lost = [each for each in outcomes if isinstance(each, RecentDrop) and each.input == _LIDAR]
    return any(window.column(each.stamp) is not None for each in lost)


if __name__ == "__main__":
    main()
