"""Draws docs/demo.svg from a real run of the demo: `python docs/draw_demo.py`."""  # noqa: INP001  no package

import io
from pathlib import Path

from rich.console import Console
from rich.terminal_theme import TerminalTheme

from syncrelay.cli.demo import prepare_ros, relay_rig
from syncrelay.cli.live import Moment, frame
from syncrelay.cli.stop import StopRequest
from syncrelay.explain import RecentDrop
from syncrelay.top.strip import Sweep, newest_stamp

_COLUMNS, _LINES = 80, 24
_STRIP = 65
_SECONDS = 16.0
_SETTLED_S = 8.0
_PICTURE = Path(__file__).parent / "demo.svg"

# Of a character in rich's pictures, in pixels, and of the margin.
_WIDTH, _HEIGHT, _MARGIN = 12.2, 24.4, 16
# rich's own frame fetches a font from a CDN; this one asks for nothing.
_FRAME = f"""\
<svg viewBox="{-_MARGIN} {-_MARGIN} {_COLUMNS * _WIDTH + 2 * _MARGIN:.0f} {_LINES * _HEIGHT + 2 * _MARGIN:.0f}" \
xmlns="http://www.w3.org/2000/svg" role="img">
<style>
.{{unique_id}}-matrix {{{{
  font-family: ui-monospace, "DejaVu Sans Mono", Menlo, Consolas, monospace;
  font-size: {{char_height}}px; line-height: {{line_height}}px; white-space: pre;
}}}}
{{styles}}
</style>
<defs>{{lines}}</defs>
<rect x="{-_MARGIN}" y="{-_MARGIN}" width="100%" height="100%" rx="10" fill="#1b1f24"/>
{{backgrounds}}
<g class="{{unique_id}}-matrix">
{{matrix}}
</g>
</svg>
"""
_BLACK, _WHITE = (27, 31, 36), (208, 214, 222)
_RED, _GREEN, _YELLOW = (248, 81, 73), (86, 194, 103), (210, 153, 34)
_BLUE, _MAGENTA, _CYAN = (88, 166, 255), (188, 140, 255), (57, 197, 207)
_THEME = TerminalTheme(_BLACK, _WHITE, [_BLACK, _RED, _GREEN, _YELLOW, _BLUE, _MAGENTA, _CYAN, _WHITE])


def main() -> None:
    """Run the demo and draw the moment that shows most."""
    prepare_ros()
    moments: list[Moment] = []
    relay_rig(moments.append, total_s=_SECONDS, seed=0, stop=StopRequest())
    best = max((moment for moment in moments if moment.elapsed_s > _SETTLED_S), key=_fullness)
    console = Console(
        file=io.StringIO(), width=_COLUMNS, height=_LINES, force_terminal=True, color_system="256", record=True
    )
    console.print(frame(best, width=_COLUMNS, height=_LINES))
    console.save_svg(str(_PICTURE), theme=_THEME, code_format=_FRAME, unique_id="demo")


def _fullness(moment: Moment) -> tuple[bool, int]:
    """Prefer a moment that shows a lost set, and then one at which the sweep is about to begin again."""
    states = tuple(figures.state for figures in moment.groups)
    sweep = Sweep(head=newest_stamp(outcome for state in states for outcome in state.recent), width=_STRIP)
    lidar = next(index for index, each in enumerate(states[0].inputs) if "lidar" in each.topic)
    lost = [one for one in states[0].recent if isinstance(one, RecentDrop) and one.input == lidar]
    return any(sweep.column(one.stamp) for one in lost), sweep.column(sweep.head) or 0


if __name__ == "__main__":
    main()
