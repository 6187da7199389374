"""A user at a headless terminal."""

import time


class Terminal:
    """Reads the lines of a screen and presses keys."""

    def __init__(self, app, pilot):
        self.app, self.pilot = app, pilot

    @property
    def lines(self):
        # Textual has no public way to the text of a screen.
        strips = self.app.screen._compositor.render_strips()  # noqa: SLF001
        return [strip.text.rstrip() for strip in strips]

    @property
    def text(self):
        return "\n".join(self.lines)

    async def press(self, *keys):
        await self.pilot.press(*keys)
        await self.pilot.pause()

    async def sees(self, text, *, deadline_s=60.0):
        end = time.monotonic() + deadline_s
        while text not in self.text:
            assert time.monotonic() < end, f"waited in vain for {text!r}:\n{self.text}"
            await self.pilot.pause(0.05)
