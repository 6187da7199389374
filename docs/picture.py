"""Writes what a terminal shows as a picture that asks for nothing from the net."""  # noqa: INP001  no package

import io
from pathlib import Path

from rich.console import Console, RenderableType
from rich.terminal_theme import TerminalTheme

COLUMNS, LINES = 80, 24

# Of a character in rich's pictures, in pixels, and of the margin.
_WIDTH, _HEIGHT, _MARGIN = 12.2, 24.4, 16
# rich's own frame fetches a font from a CDN; this one does not.
_FRAME = f"""\
<svg viewBox="{-_MARGIN} {-_MARGIN} {COLUMNS * _WIDTH + 2 * _MARGIN:.0f} {LINES * _HEIGHT + 2 * _MARGIN:.0f}" \
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


def draw(shown: RenderableType, picture: Path) -> None:
    """Write what a terminal of COLUMNS and LINES shows as SVG."""
    console = Console(
        file=io.StringIO(), width=COLUMNS, height=LINES, force_terminal=True, color_system="256", record=True
    )
    console.print(shown)
    console.save_svg(str(picture), theme=_THEME, code_format=_FRAME, unique_id=picture.stem)
