"""The page of an analysis in a real Chromium, without screen or network: what it draws, and what one can do there."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from syncrelay.recordings.analysis import Analysis
from syncrelay.recordings.analysis.html import as_html
from syncrelay.recordings.analysis.report_json import as_json
from tests.browser import launched, needs_chromium, opened
from tests.recordings.analysis.html_reports import HOSTILE, TOPICS, analyzed, drive, of_device, renamed
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import inputs
from tests.ros.streams import jittery, merged

pytestmark = [pytest.mark.browser, needs_chromium]

_DRAWN = """() => [...document.querySelectorAll(".chart")].map((chart) => {
  const canvas = chart.querySelector("canvas");
  if (!canvas) return 0;
  const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.reduce((sum, value, at) => sum + (at % 4 === 3 && value > 0), 0);
})"""
_HAS_COLOUR = """([place, name]) => {
  const [r, g, b] = colour(name).match(/[0-9a-f]{2}/g).map((part) => parseInt(part, 16));
  const canvas = document.querySelector(`${place} canvas`);
  const {data} = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  for (let at = 0; at < data.length; at += 4) {
    if (data[at] === r && data[at + 1] === g && data[at + 2] === b && data[at + 3] === 255) return true;
  }
  return false;
}"""
_SHOWN = '() => { const {x} = plots.find((plot) => plot.root.closest(".lanes")).scales; return [x.min, x.max]; }'


class Opened:
    """A report that is open."""

    def __init__(self, opened) -> None:
        self.page, self.requests, self.complaints = opened.page, opened.requests, opened.complaints

    def shown(self) -> list[float]:
        """The part of the recording that the lanes show, in seconds."""
        return self.page.evaluate(_SHOWN)

    def told(self) -> str:
        """What stands below the lanes."""
        return self.page.locator(".readout").first.text_content()


@pytest.fixture(scope="module")
def browser():
    with launched() as running:
        yield running


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("browser")


@pytest.fixture(scope="module")
def analysis(folder) -> Analysis:
    return analyzed(folder, drive(seconds=30))


@pytest.fixture(scope="module")
def report(folder, analysis) -> Path:
    path = folder / "report.html"
    path.write_text(as_html("drive.mcap", analysis))
    return path


@contextmanager
def _opened(browser, path: Path, *, scheme: str = "light", width: int = 1200) -> Iterator[Opened]:
    with opened(browser, scheme=scheme, width=width, offline=True) as page:
        report = Opened(page)
        report.page.goto(path.as_uri())
        report.page.wait_for_selector("html[data-drawn]", state="attached")
        yield report


@pytest.fixture(scope="module")
def shared(browser, report) -> Iterator[Opened]:
    with _opened(browser, report) as page:
        yield page


@pytest.fixture
def seen(shared) -> Opened:
    """The report with all of the recording in view."""
    shared.page.locator(".lanes").focus()
    shared.page.keyboard.press("0")
    return shared


@pytest.mark.parametrize(("scheme", "width"), [("light", 360), ("dark", 1200)])
def test_everything_is_drawn_without_a_complaint_or_a_request(scheme, width, browser, report):
    with _opened(browser, report, scheme=scheme, width=width) as opened:
        drawn = opened.page.evaluate(_DRAWN)
        assert len(drawn) == 9
        assert min(drawn) > 1000
        assert opened.complaints == []
        assert opened.requests == [report.as_uri()]
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= width
        for name in ("matched", "too_far"):
            assert opened.page.evaluate(_HAS_COLOUR, [".lanes", name])
        assert opened.page.evaluate(_HAS_COLOUR, [".by-slop", "now"])
        paper = opened.page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert paper == {"light": "rgb(255, 255, 255)", "dark": "rgb(18, 22, 27)"}[scheme]


@pytest.mark.parametrize(("scheme", "width"), [("dark", 390), ("light", 1400)])
def test_how_a_device_was_mapped_is_drawn_with_its_line_and_the_settings_of_its_clock(scheme, width, browser, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(as_html("drive.mcap", of_device(tmp_path, seconds=60)))
    with _opened(browser, path, scheme=scheme, width=width) as opened:
        assert opened.complaints == []
        for name in ("curve", "second", "now"):
            assert opened.page.evaluate(_HAS_COLOUR, [".mapping", name]), name
        assert opened.page.evaluate("document.documentElement.scrollWidth") <= width


def test_of_many_pairs_the_farthest_apart_are_seen_first_and_the_rest_is_drawn_when_it_is_unfolded(browser, tmp_path):
    topics = [f"/sensor_{number}/points" for number in range(5)]
    streams = [
        jittery(topic, period_ms=100, jitter_ms=3 + 3 * at, count=100, seed=at) for at, topic in enumerate(topics)
    ]
    seven = analyzed(tmp_path, merged(*streams), topics=inputs(dict.fromkeys(topics, VECTOR)), slop="20ms")
    path = tmp_path / "report.html"
    path.write_text(as_html("drive.mcap", seven))
    of_all = [pair.distance.high for pair in seven.groups[0].pairs]
    with _opened(browser, path, width=360) as opened:
        page = opened.page
        seen = page.locator(".histogram:visible").evaluate_all("all => all.map((each) => Number(each.dataset.pair))")
        assert [of_all[at] for at in seen] == sorted(of_all, reverse=True)[:4]
        page.get_by_text("6 more pairs, less far apart").click()
        everywhere = page.locator(".histogram:visible").evaluate_all("all => all.map((each) => each.dataset.pair)")
        assert sorted(map(int, everywhere)) == list(range(10))
        # What was folded has the width of its place once it is seen.
        page.wait_for_function(
            "() => [...document.querySelectorAll('.histogram')]"
            ".every((each) => Math.abs(each.querySelector('canvas').clientWidth - each.clientWidth) < 2)"
        )
        assert page.evaluate("document.documentElement.scrollWidth") <= 360
        assert page.locator(".wide").evaluate_all("all => all.every((each) => each.scrollWidth <= each.clientWidth)")


def test_a_change_of_scheme_is_drawn_at_once(seen):
    light = seen.page.evaluate("colour('matched')")
    seen.page.emulate_media(color_scheme="dark")
    seen.page.wait_for_function(_HAS_COLOUR, arg=[".lanes", "matched"])
    assert seen.page.evaluate("colour('matched')") != light


def test_the_tables_hold_the_figures_of_the_json(seen, analysis):
    told = json.loads(json.dumps(as_json("drive.mcap", analysis)))
    (group,) = told["groups"]
    fates = [head.strip() for head in seen.page.locator(".fates thead th").all_text_contents()]
    rows = [row.split() for row in seen.page.locator(".fates tbody tr").all_inner_texts()]
    cells = seen.page.locator("#topics ~ .wide tbody tr td:nth-child(3)").all_text_contents()
    assert [int(cell) for cell in cells] == [topic["messages"] for topic in told["topics"]]
    for row, expected in zip(rows, group["inputs"], strict=True):
        counts = dict(zip(fates[1:-1], map(int, row[1:-1]), strict=True))
        assert row[0] == expected["topic"]
        assert int(row[-1]) == expected["received"] == sum(counts.values())
        assert counts.pop("in sets") == expected["matched"]
        assert counts.pop("not needed") == expected["unneeded"]
        assert sum(counts.values()) == sum(expected["dropped"].values()) - expected["unneeded"]
        assert all(count <= expected["dropped"].get(fate, 0) for fate, count in counts.items())


def test_what_is_drawn_of_each_lane_adds_up(seen, analysis):
    drawn = seen.page.evaluate(
        "async () => { const {groups} = JSON.parse(document.getElementById('drawings').textContent);"
        " const {lanes} = await unpackTimeline(groups[0].timeline);"
        " return lanes.map(({fates}) => [fates.length, fates.filter((fate) => fate === MATCHED).length]); }"
    )
    assert drawn == [[counts.fed, counts.matched] for counts in analysis.groups[0].evaluation.counts]


def test_keys_move_zoom_and_step_through_what_went_into_no_set(seen):
    keyboard = seen.page.keyboard
    begin, end = seen.shown()
    assert end - begin > 29
    keyboard.press("+")
    closer = seen.shown()
    assert closer[1] - closer[0] == pytest.approx((end - begin) / 2)
    keyboard.press("ArrowRight")
    assert seen.shown()[0] == pytest.approx(closer[0] + (closer[1] - closer[0]) / 4)
    keyboard.press("0")
    assert seen.shown() == [begin, end]
    keyboard.press("n")
    first = seen.told()
    assert "no set, " in first
    keyboard.press("n")
    assert seen.told() != first
    keyboard.press("p")
    assert seen.told() == first


def test_buttons_do_the_same_and_are_reached_by_tab(seen):
    before = seen.shown()
    seen.page.get_by_role("button", name="Zoom in").focus()
    seen.page.keyboard.press("Enter")
    assert seen.shown() != before
    seen.page.keyboard.press("Tab")
    assert seen.page.evaluate("document.activeElement.textContent") == "Zoom out"
    seen.page.keyboard.press("Enter")
    assert seen.shown() == pytest.approx(before)


def test_dragging_over_the_whole_shows_that_part(seen):
    over = seen.page.locator(".overview .u-over")
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    mouse, middle = seen.page.mouse, box["y"] + box["height"] / 2
    mouse.move(box["x"] + box["width"] * 0.25, middle)
    mouse.down()
    mouse.move(box["x"] + box["width"] * 0.5, middle, steps=4)
    mouse.up()
    assert seen.shown() == [pytest.approx(7.5, abs=0.5), pytest.approx(15, abs=0.5)]


def test_pointing_at_a_message_tells_what_became_of_it(seen):
    lanes = seen.page.locator(".lanes .u-over")
    lanes.scroll_into_view_if_needed()
    box = lanes.bounding_box()
    for step in range(40):
        seen.page.mouse.move(box["x"] + 300 + step * 8, box["y"] + 10)
        if "in a set of span" in seen.told():
            break
    assert seen.told().startswith(f"{TOPICS[0]} at ")
    assert "in a set of span" in seen.told()


def test_all_that_is_drawn_has_words(seen):
    nameless = seen.page.evaluate(
        "() => [...document.querySelectorAll('[role=img], [role=group], [role=region], .chart')]"
        ".filter((each) => !each.getAttribute('aria-label')).length"
    )
    assert nameless == 0
    for name in ("Zoom in", "Earlier", "Next unmatched"):
        assert seen.page.get_by_role("button", name=name).count() == 1
    assert seen.page.get_by_role("img", name="/camera: 300 received").count() == 1
    assert seen.page.get_by_role("group", name="Messages and sets of fused").count() == 1


def test_names_from_strangers_run_nothing(browser, folder, analysis):
    path = folder / "hostile.html"
    path.write_text(as_html(HOSTILE, renamed(analysis)))
    with _opened(browser, path) as opened:
        assert opened.page.evaluate("window.stranger") is None
        assert opened.page.locator("h1").text_content() == HOSTILE
        assert opened.page.locator("tbody code").first.text_content() == HOSTILE
        assert opened.page.locator("img").count() == 0
        assert (opened.complaints, opened.requests) == ([], [path.as_uri()])
