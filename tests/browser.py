"""A real Chromium, headless."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install '.[test]'")

_CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# Alone, no test takes a second; two may share a core with other tests.
_PATIENCE_MS = 120_000

needs_chromium = pytest.mark.skipif(_CHROMIUM is None, reason="there is no chromium: apt-get install chromium")


class Opened:
    """A page, the URLs that it requested, and its console messages and errors."""

    def __init__(self, page) -> None:
        self.page = page
        self.requests: list[str] = []
        self.complaints: list[str] = []
        page.on("request", lambda request: self.requests.append(request.url))
        page.on("console", lambda message: self.complaints.append(message.text))
        page.on("pageerror", lambda error: self.complaints.append(str(error)))


@contextmanager
def launched() -> Iterator:
    with sync_api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=_CHROMIUM, timeout=_PATIENCE_MS)
        yield running
        running.close()


@contextmanager
def opened(browser, *, scheme: str = "light", width: int = 1200, offline: bool = False) -> Iterator[Opened]:
    """An empty page."""
    context = browser.new_context(color_scheme=scheme, viewport={"width": width, "height": 900}, offline=offline)
    context.set_default_timeout(_PATIENCE_MS)
    yield Opened(context.new_page())
    context.close()
