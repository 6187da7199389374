"""The relay's page in a real Chromium: what it shows, and its controls."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest

from syncrelay.explain import Sender
from syncrelay.status import RelayState
from tests.browser import Opened, launched, needs_chromium, opened
from tests.hostile_names import FORGED, hostile_name
from tests.status.support.serving import Relay, running
from tests.top import states

pytestmark = [pytest.mark.browser, needs_chromium]

_STATES = {"light": "rgb(255, 255, 255)", "dark": "rgb(18, 22, 27)"}
_SHOWN = "html[data-shown]"


@pytest.fixture(scope="module")
def browser():
    with launched() as running:
        yield running


@contextmanager
def watching(browser, state: RelayState, *, at: str = "", **options) -> Iterator[tuple[Opened, Relay]]:
    with running(state) as relay, opened(browser, **options) as page:
        page.page.goto(f"{relay.url}/{at}")
        page.page.wait_for_selector(_SHOWN, state="attached")
        yield page, relay


def chosen(page) -> str:
    return page.locator("#groups [aria-current=true] strong").text_content()


@pytest.mark.parametrize(("scheme", "width"), [("light", 390), ("dark", 1600)])
def test_everything_is_shown_without_a_complaint_or_a_request_elsewhere(scheme, width, browser):
    with watching(browser, states.rig(), at="#front", scheme=scheme, width=width) as (opened_page, relay):
        page = opened_page.page
        assert page.locator("#node").text_content() == "/syncrelay"
        assert page.locator("#headline").text_content() == "3 of 4 groups fail: no sets from inertial, radar and rear"
        assert page.title() == "✖ 3 of 4 groups fail: no sets from inertial, radar and rear · /syncrelay"
        assert page.locator("#icon").get_attribute("data-level") == "error"
        assert page.locator("#groups .group strong").all_text_contents() == ["inertial", "radar", "rear", "front"]
        assert page.locator("#groups .group > .level").all_text_contents() == ["ERROR", "ERROR", "ERROR", "OK"]
        assert "10 of 10 sets/s" in page.locator("#groups .group .figures").last.text_content()
        assert page.locator("#group .spark").all_inner_texts()[1].startswith("latency: p50 2.56 ms, p95 9.01 ms")
        assert page.locator("#group .lanes .joint").count() > 5
        assert page.locator("#group .lanes .fate-unneeded").count() > 5
        assert page.locator("#group .lanes .fate-too_far").count() == 0
        assert page.locator("#group .keys").text_content() == "joined: a set not needed"
        assert "200 not needed" in page.locator("#group .input dl").first.text_content()
        assert page.locator("#group h4").all_text_contents() == ["/camera/image_raw", "/lidar/points"]
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == _STATES[scheme]
        assert opened_page.complaints == []
        assert {request.removeprefix(relay.url) for request in opened_page.requests} - {"data:,"} == {
            *("/", "/colours.css", "/page.css", "/draw.js", "/page.js", "/status")
        }


def test_a_group_is_chosen_by_keys_and_by_the_address_and_says_what_to_write(browser):
    with watching(browser, states.rig(), at="#inertial") as (opened_page, _):
        page = opened_page.page
        assert chosen(page) == "inertial"
        page.keyboard.press("j")
        page.keyboard.press("j")
        assert chosen(page) == "rear"
        assert page.url.endswith("#rear")
        shown = page.locator("#group .findings").text_content()
        assert "stamps of /rear/image_raw are 37.2 s behind those of /lidar/points" in shown
        assert page.locator("#group .fix code").all_text_contents() == ["clock", "delay"]
        page.keyboard.press("ArrowUp")
        assert chosen(page) == "radar"
        page.keyboard.press("s")
        assert page.locator("#groups strong").all_text_contents()[0] == "front"
        page.locator("#groups button", has_text="radar").click()
        assert page.locator("#group h2").text_content() == "radar"


def test_it_is_live_and_asks_for_nothing_while_it_is_frozen(browser):
    with watching(browser, states.healthy()) as (opened_page, relay):
        page = opened_page.page
        page.clock.install()
        page.reload()
        relay.state = states.rig()
        page.wait_for_selector("#groups .group:nth-child(4)")
        page.keyboard.press(" ")
        assert page.locator("#freeze").get_attribute("aria-pressed") == "true"
        asked = len(opened_page.requests)
        page.clock.run_for(10_000)
        assert len(opened_page.requests) == asked
        relay.state = states.healthy()
        page.keyboard.press(" ")
        page.wait_for_selector("#groups .group:nth-child(2)", state="detached")


def test_what_has_not_changed_stays_so_that_it_can_be_copied(browser):
    with watching(browser, states.rig(), at="#rear") as (opened_page, _):
        page = opened_page.page
        page.evaluate("document.querySelector('#group .fix').id = 'marked'")
        shown = int(page.locator("html").get_attribute("data-shown"))
        page.wait_for_selector(f"html[data-shown='{shown + 2}']", state="attached")
        assert page.locator("#marked").count() == 1


def test_when_the_relay_goes_its_last_state_stays_and_is_said_to_be_stale(browser):
    with watching(browser, states.rig()) as (opened_page, relay):
        page = opened_page.page
        relay.stop()
        page.wait_for_selector("#trouble:not([hidden])")
        assert "STALE: no answer for " in page.locator("#trouble").text_content()
        assert page.locator("#groups .group").count() == 4
        relay.start()
        page.wait_for_selector("#trouble", state="hidden")


def many() -> RelayState:
    """Twenty groups."""
    told = states.rig()
    report = told.groups[0]
    named = (replace(report, facts=replace(report.facts, name=f"group_{number}")) for number in range(20))
    return replace(told, groups=tuple(named))


def _is_seen(page, selector: str) -> bool:
    seen = "each => (({top, bottom}) => top >= 0 && top < innerHeight - 40 && bottom > 0)(each.getBoundingClientRect())"
    return page.locator(selector).first.evaluate(seen)


def test_on_a_phone_a_group_opens_in_its_place_in_the_list_and_closes_again(browser):
    with watching(browser, many(), width=390) as (opened_page, _):
        page = opened_page.page
        assert page.locator("#group").is_hidden()
        row = page.locator("#groups button", has_text="group_7")
        row.click()
        assert page.locator("#group h2").text_content() == "group_7"
        assert row.evaluate("each => each.nextElementSibling.id") == "group"
        assert _is_seen(page, "#groups [aria-expanded=true]")
        page.locator("#groups button", has_text="group_8").click()
        assert page.locator("#group h2").text_content() == "group_8"
        assert _is_seen(page, "#groups [aria-expanded=true]")
        page.locator("#groups button", has_text="group_8").click()
        assert page.locator("#group").is_hidden()
        page.set_viewport_size({"width": 1600, "height": 900})
        page.wait_for_selector("main > #group:not([hidden])")


@pytest.mark.parametrize("width", [390, 1600])
def test_what_several_groups_suffer_of_is_one_card_that_shows_these_groups(width, browser):
    group = states.group({"/camera/image_raw": states.IMAGE, "/lidar/points": states.CLOUD})
    sensors = {
        "/camera/image_raw": states.CAMERA,
        "/lidar/points": replace(states.LIDAR, until_s=12),
        "/imu/data": states.IMU_200,
    }
    well = states.group({"/camera/image_raw": states.IMAGE, "/imu/data": states.IMU})
    with watching(browser, states.simulated(states.file(a=group, b=well, c=group), sensors), width=width) as (shown, _):
        page = shown.page
        card = page.locator("#troubles article")
        assert card.count() == 1
        assert "ERROR no more sets for 18 s: /lidar/points has been silent for 18 s" in card.text_content()
        assert card.locator("button").text_content() == "2 groups: a, c"
        card.locator("button").click()
        assert page.locator("#groups .group strong").all_text_contents() == ["a", "c"]
        card.locator("button").click()
        assert page.locator("#groups .group").count() == 3
        page.keyboard.press("/")
        page.keyboard.type("imu")
        assert page.locator("#groups .group strong").all_text_contents() == ["b"]
        page.keyboard.type(" and nothing")
        assert page.locator("#groups").text_content() == 'no group has "imu and nothing"'
        page.keyboard.press("Escape")
        assert page.locator("#groups .group").count() == 3
        assert shown.complaints == []


def test_the_chosen_group_stays_beside_a_long_list_and_where_the_focus_is_can_be_seen(browser):
    with watching(browser, many(), width=1600) as (opened_page, _):
        page = opened_page.page
        assert page.locator("#back").is_hidden()
        for _press in range(19):
            page.keyboard.press("j")
        assert page.evaluate("scrollY") > 0
        assert _is_seen(page, "#group h2")
        row = page.locator("#groups [aria-current=true]")
        assert row.evaluate("each => getComputedStyle(each).outlineStyle") == "solid"
        row.evaluate("each => each.blur()")
        assert row.evaluate("each => getComputedStyle(each).outlineStyle") == "none"
        assert row.evaluate("each => getComputedStyle(each).boxShadow") != "none"


def test_an_answer_of_something_else_is_said_and_another_version_brings_its_own_page(browser):
    with watching(browser, states.rig()) as (opened_page, _):
        page = opened_page.page
        page.route("**/status", lambda route: route.fulfill(json={"groups": 3}))
        page.wait_for_selector("#trouble:has-text('what answers there is not a relay; still trying')")
        page.unroute("**/status")
        page.wait_for_selector("#trouble", state="hidden")
        told = page.evaluate("({...state, relay: {...state.relay, version: '99'}})")
        with page.expect_event("load"):
            page.route("**/status", lambda route: route.fulfill(json=told))
        page.wait_for_selector("#relay:has-text('syncrelay 99')")


def test_a_relay_without_groups_has_a_page_too(browser):
    with watching(browser, replace(states.rig(), groups=())) as (opened_page, _):
        assert opened_page.page.locator("#groups").text_content().startswith("no group is running yet: ")
        assert opened_page.complaints == []


def test_names_from_strangers_run_nothing_and_hide_nothing(browser):
    chance = random.Random(18)
    told = states.rig()
    report = told.groups[1]
    facts = report.facts
    inputs = tuple(
        replace(each, graph=replace(each.graph, name=hostile_name(chance), output=hostile_name(chance)))
        for each in facts.inputs
    )
    named = replace(report, facts=replace(facts, name=hostile_name(chance), inputs=inputs))
    state = replace(told, node=hostile_name(chance), config=hostile_name(chance), groups=(named,))
    with watching(browser, state) as (opened_page, _):
        page = opened_page.page
        assert page.locator("img").count() == 0
        assert page.locator("script").count() == 3
        for text in page.locator("h1, h2, h4, strong, dd, #relay, text, title").all_text_contents():
            assert text.isprintable(), text
        lines = page.locator("body").inner_text().split("\n")
        assert [line for line in lines if line.startswith(FORGED)] == []
        page.keyboard.press("j")
        assert opened_page.complaints == []


def test_a_row_of_the_list_has_the_colour_of_its_level_and_keeps_figures_and_units_together(browser):
    with watching(browser, states.rig()) as (opened_page, _):
        for colour, has in (("borderLeftColor", ".group"), ("color", ".group > .level")):
            found = opened_page.page.locator(f"#groups {has}").evaluate_all(
                f"all => all.map(each => getComputedStyle(each).{colour})"
            )
            assert len(set(found)) == 2
            assert found[:3] == [found[0]] * 3
        figures = opened_page.page.locator("#groups .figures span")
        assert figures.count() == 3 * 4
        assert figures.evaluate_all("all => all.map(each => getComputedStyle(each).whiteSpace)") == ["nowrap"] * 12


def test_a_policy_without_a_tolerance_shows_none(browser):
    text = states.file(pair={"policy": "exact_time", "topics": states.FRONT["topics"]})
    with watching(browser, states.simulated(text, {})) as (opened_page, _):
        assert "exact_time, queue_size 10" in opened_page.page.locator("#group .head").text_content()


def test_inputs_without_publishers_and_subscribers_say_so_and_a_finding_about_both_marks_both(browser):
    told = states.nothing()
    (report,) = told.groups
    inputs = tuple(replace(each, graph=replace(each.graph, subscribers=())) for each in report.facts.inputs)
    state = replace(told, groups=(replace(report, facts=replace(report.facts, inputs=inputs)),))
    with watching(browser, state) as (opened_page, _):
        notes = opened_page.page.locator("#group h4 .level").all_text_contents()
        assert [each.strip() for each in notes] == ["no publisher", "no publisher"]
        shown = opened_page.page.locator("#group .input").first.inner_text()
        assert "no publishers" in shown
        assert "/front/camera/image_raw: no subscribers" in shown
        assert "in total" in shown


def test_without_sets_the_messages_of_the_slowest_input_are_apart(browser):
    with watching(browser, states.rig(), at="#radar") as (opened_page, _):
        places = opened_page.page.locator("#group .lanes .shape").evaluate_all(
            "all => all.filter(each => each.closest('svg').getAttribute('role')).map(each => each.getCTM().e)"
        )
        assert len(places) > 10
        assert max(places) - min(places) > 17 * (len(places) - 1)


@pytest.mark.parametrize(("scheme", "width"), [("dark", 390), ("light", 1400)])
def test_of_each_publisher_it_is_shown_what_was_sent_delivered_and_lost(scheme, width, browser):
    told = states.rig()
    report, *others = told.groups
    camera, lidar = report.facts.inputs
    senders = Sender("/usb_cam", 200, 188, sent_hz=20.0), Sender("/spare_cam", 4, 4)
    inputs = tuple(replace(of, graph=replace(of.graph, senders=each)) for of, each in ((camera, senders), (lidar, ())))
    state = replace(told, groups=(replace(report, facts=replace(report.facts, inputs=inputs)), *others))
    with watching(browser, state, at="#front", scheme=scheme, width=width) as (opened_page, _):
        shown = opened_page.page.locator("#group .input dl").all_inner_texts()
        sent = "200 by /usb_cam at 20 Hz: 188 delivered, 12 lost; 4 by /spare_cam: 4 delivered, 0 lost"
        assert f"sent in the last 10 s\n{sent}\n" in shown[0]
        assert "sent in the last 10 s" not in shown[1]
        assert opened_page.page.evaluate("document.documentElement.scrollWidth") <= width
        assert opened_page.complaints == []
