"""The page of a fleet in a real Chromium, without screen or network: what it shows, and how it is filtered."""

import pytest

from syncrelay.cli.fleet_html import fleet_as_html
from syncrelay.recordings.fleet.report import Failure, fleet_report
from tests.browser import launched, needs_chromium, opened
from tests.cli.html_reports import HOSTILE
from tests.recordings.fleet.documents import change, document, finding, fleet, group

pytestmark = [pytest.mark.browser, needs_chromium]


@pytest.fixture(scope="module")
def browser():
    with launched() as running:
        yield running


@pytest.fixture(scope="module")
def page_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("fleet") / "fleet.html"
    path.write_text(fleet_as_html(fleet_report(fleet(300), failed=[Failure("/data/x.mcap", "/data/x.mcap: is torn")])))
    return path


def _shown(page, key):
    """The names that a table shows."""
    return page.locator(f'[data-table="{key}"] tbody th').all_text_contents()


def _visit(page, path):
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-drawn]", state="attached")


@pytest.mark.parametrize(("width", "scheme"), [(360, "light"), (1200, "light"), (1200, "dark")])
def test_it_fits_without_a_complaint_or_a_request(width, scheme, browser, page_file):
    with opened(browser, scheme=scheme, width=width, offline=True) as it:
        _visit(it.page, page_file)
        assert it.complaints == []
        assert it.requests == [page_file.as_uri()]
        assert it.page.evaluate("document.documentElement.scrollWidth") <= width
        paper = it.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert paper == {"light": "rgb(255, 255, 255)", "dark": "rgb(18, 22, 27)"}[scheme]
        nameless = it.page.evaluate(
            "() => [...document.querySelectorAll('[role=img], [role=region], input')]"
            ".filter((each) => !each.getAttribute('aria-label')).length"
        )
        assert nameless == 0


def test_a_filter_shows_the_rows_that_have_all_its_words(browser, page_file):
    with opened(browser, offline=True) as it:
        _visit(it.page, page_file)
        assert _shown(it.page, "robots")[0] == "robot_03"
        assert len(_shown(it.page, "recordings")) == 50
        it.page.get_by_label("Filter recordings").fill("ROBOT_07 2024-05-02")
        shown = _shown(it.page, "recordings")
        assert len(shown) == 1
        assert shown[0].startswith("robot_07/2024-05-02/")
        section = it.page.locator('[data-table="recordings"]')
        assert section.locator("output").text_content() == "1 of 1 shown"
        assert section.locator(".more").is_hidden()
        assert len(_shown(it.page, "robots")) == 40
        it.page.get_by_label("Filter recordings").fill("")
        section.locator(".more").click()
        assert len(_shown(it.page, "recordings")) == 100


def test_names_from_strangers_run_nothing(browser, tmp_path):
    found = {**finding("over_slop"), "text": HOSTILE}
    hostile = document(group(9, 10, change("slop", HOSTILE), name=HOSTILE, topics=(HOSTILE, "/b"), findings=[found]))
    report = fleet_report([(f"/fleet/{HOSTILE}/a.mcap", hostile), ("/fleet/r2/b.mcap", hostile), (HOSTILE, None)])
    path = tmp_path / "hostile.html"
    path.write_text(fleet_as_html(report))
    with opened(browser, offline=True) as it:
        _visit(it.page, path)
        assert it.page.evaluate("window.stranger") is None
        assert it.page.locator("img").count() == 0
        assert (it.complaints, it.requests) == ([], [path.as_uri()])
        assert _shown(it.page, "groups") == [HOSTILE]
