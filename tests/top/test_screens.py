"""The text of the screens, on a headless terminal, with the relay's server."""

import asyncio
import re
from contextlib import ExitStack
from dataclasses import replace

import pytest

from syncrelay.explain import explanation
from syncrelay.status import Phase
from syncrelay.top.app import EndedError, TopApp
from syncrelay.top.client import ask
from tests.status.support.serving import running
from tests.top import states
from tests.top.terminal import Terminal

_SMALL, _WIDE = (80, 24), (160, 45)


def before(*told, size=_SMALL):
    """Run a coroutine as a user at a terminal, with a relay in each of these states."""

    def sit(act):
        async def look():
            with ExitStack() as stack:
                relays = [stack.enter_context(running(state())) for state in told]
                app = TopApp([ask(relay.url) for relay in relays], period_s=0.1)
                async with app.run_test(size=size) as pilot:
                    await pilot.pause()
                    return await act(Terminal(app, pilot), *relays)

        return lambda: asyncio.run(look())

    return sit


def at_terminal(state, *keys, size=_SMALL):
    """The lines of a terminal after some keys."""

    @before(lambda: state, size=size)
    async def look(user, *_):
        await user.press(*keys)
        return user.lines

    return look()


def _begins_with(sentence, line):
    """Whether a line is the beginning of a sentence that continues on the next line."""
    return len(line) > 40 and sentence.startswith(line)


def test_groups_are_listed_with_state_rates_and_reason_and_the_selected_one_below():
    state = states.rig()
    lines = at_terminal(state, "end")
    assert lines[0] == "3 of 4 groups fail: no sets from inertial, radar and rear"
    assert lines[1].startswith("/syncrelay at 127.0.0.1:")
    assert lines[1].endswith("running, not ready, up 30 s")
    assert lines[2] == "  GROUP     STATE▾ SETS/s        SPAN p95  LAT. p95  FINDING or SPANS"
    assert lines[3] == "  inertial  ERROR  0 of 10       -         -         short queue"
    assert lines[4] == "  radar     ERROR  0 of 0        -         -         no publisher"
    assert lines[5] == "  rear      ERROR  0 of 10       -         -         other clock"
    assert lines[6].startswith("▶ front     OK     10 of 10  ")
    assert lines[7].startswith("── front: approximate_time, slop 20 ms, queue_size 10 ──")
    assert _begins_with(f"OK       {explanation(state.groups[0].findings).text}", lines[8])
    text = "\n".join(lines)
    assert "/camera/image_raw 30 Hz     27.5 ms   4.25 ms   200 not needed" in text
    assert "Open" in lines[-1]
    assert "Quit" in lines[-1]


def test_the_smallest_screen_has_room_for_the_finding_in_place_of_the_latency():
    lines = at_terminal(states.rig(), size=(60, 15))
    assert lines[2] == "  GROUP     STATE▾ SETS/s        SPAN p95  FINDING"
    assert lines[4] == "  radar     ERROR  0 of 0        -         no publisher"
    assert lines[5] == "  rear      ERROR  0 of 10       -         other clock"


def test_one_that_only_observes_is_told_by_its_file():
    lines = at_terminal(replace(states.healthy(), phase=Phase.OBSERVING, config="fusion.yaml"))
    assert lines[1].startswith("/syncrelay with fusion.yaml ")
    assert lines[1].endswith("observing, ready, up 30 s")


def test_it_ends_with_what_it_watches():
    async def watch():
        with running(states.healthy()) as server:
            relays, asked = [ask(server.url)], []

            def source(url):
                asked.append(url)
                raise EndedError("it ended")

            await TopApp(relays, source=source, period_s=0.01).run_async(headless=True)
            assert set(asked) == {server.url}

    asyncio.run(asyncio.wait_for(watch(), 60))


def test_a_managed_node_without_groups_says_what_it_waits_for():
    lines = at_terminal(replace(states.healthy(), phase=Phase.UNCONFIGURED, groups=()))
    assert "unconfigured, not ready" in lines[1]
    assert (
        " ".join(lines[2:4]) == "the node is unconfigured: configure it with `ros2 lifecycle set /syncrelay configure`"
    )


def test_a_selected_group_says_what_is_wrong_and_what_to_do():
    finding = states.rig().groups[1].findings[0]
    lines = at_terminal(states.rig(), "end", "k")
    assert lines[5].startswith("▶ rear")
    assert lines[7].startswith("── rear:")
    assert lines[8] == f"ERROR    {finding.text}"
    assert _begins_with(f"       → {finding.suggestion}", lines[9])
    row = 1 + next(place for place, line in enumerate(lines) if line.startswith("INPUT"))
    assert lines[row].startswith("/rear/image_raw 30 Hz     37.2 s    2.83 ms   other clock; 100 too_far, 200 ")


def test_a_wide_terminal_shows_spans_latencies_the_sentence_and_recent_sets():
    lines = at_terminal(states.rig(), size=_WIDE)
    assert "SPANS                 LATENCIES             FINDING" in lines[2]
    assert states.rig().groups[3].findings[0].text in lines[4]
    assert any(line.strip().startswith("imu ▏") for line in lines)


@before(states.rig)
async def test_groups_are_sorted_and_the_selected_one_stays_selected(user, *_):
    for order in (
        ["▶", "radar", "rear", "front"],
        ["front", "rear", "▶", "radar"],
        ["front", "▶", "radar", "rear"],
        ["▶", "radar", "rear", "front"],
    ):
        assert [line.split()[0] for line in user.lines[3:7]] == order
        await user.press("s")
    assert "STATE▾" not in user.lines[2]


@before(states.rig)
async def test_groups_are_filtered_by_what_is_known_of_them(user, *_):
    for sought, shown in (("REAR", ["rear"]), ("other clock", ["rear"]), ("/imu", ["inertial"]), ("/lidar", 4 * [""])):
        await user.press("slash")
        await user.press(*("space" if each == " " else "slash" if each == "/" else each for each in sought))
        await user.press("enter")
        listed = [line for line in user.lines if re.match(r"(▶|  ) ?\S+ +(ERROR|OK) ", line)]
        assert len(listed) == len(shown)
        assert all(name in line for name, line in zip(shown, listed, strict=True))
        await user.press("escape")
    await user.press("slash", "x", "y", "z")
    assert "no group has 'xyz'; escape shows all" in user.text
    await user.press("escape")
    assert user.lines[3].startswith("▶ inertial")


def test_what_several_groups_suffer_of_at_once_is_said_first():
    group = states.group({"/camera/image_raw": states.IMAGE, "/lidar/points": states.CLOUD})
    sensors = {"/camera/image_raw": states.CAMERA, "/lidar/points": replace(states.LIDAR, until_s=12)}
    lines = at_terminal(states.simulated(states.file(a=group, b=group), sensors))
    assert lines[0] == "all 2 groups fail: no sets from a and b"
    assert lines[2].startswith("2 groups: no more sets for 18 s: /lidar/points has been silent for 18 s")


def test_a_group_is_opened_with_figures_findings_inputs_the_strip_and_who_publishes():
    lines = at_terminal(states.healthy(), "enter", size=(80, 45))
    assert lines[2].startswith("── front:")
    assert lines[3].startswith("sets     10 of 10 possible a second ━")
    assert lines[3].endswith("100%, 300 sets, last just now")
    assert lines[4].startswith("span     ")
    assert lines[4].endswith("p50 5.77 ms, p95 9.73 ms, max 14 ms")
    assert "▁" in next(line for line in lines if line.startswith("latency  "))
    camera = next(line for line in lines if line.startswith("       camera ▏"))
    lidar = next(line for line in lines if line.startswith("        lidar ▏"))
    assert camera.split("▏")[1].replace("·", "").split() == lidar.split("▏")[1].split()
    assert "ABC sets   · not needed" in lines
    assert "a column is 20 ms, the newest is on the right" in lines
    assert "/camera/image_raw (sensor_msgs/msg/Image)" in lines
    assert "  from /camera_driver" in lines
    assert "  as   /front/camera/image_raw, to /fusion" in lines
    assert "  900 received, 300 in sets, 2 waiting, 598 not needed, 0 dropped" in lines
    assert "  in the last 10 s: 300 from /camera_driver at 30 Hz, none lost" in lines


def test_a_type_that_is_not_known_yet_is_said_to_be_none():
    waiting = states.simulated(states.file(front=states.group({"/a": None, "/b": states.IMAGE})), {})
    lines = at_terminal(waiting, "enter", size=(80, 45))
    assert "/a (type not known yet)" in lines
    assert "/b (sensor_msgs/msg/Image)" in lines


@before(states.rig)
async def test_keys_lead_through_the_groups_and_back(user, *_):
    for key, sees in (
        ("enter", "── inertial"),
        ("right", "── radar"),
        ("n", "── rear"),
        ("left", "── radar"),
        ("p", "── inertial"),
        ("p", "── front"),
    ):
        await user.press(key)
        assert user.lines[2].startswith(sees)
    await user.press("end")
    assert not user.lines[2].startswith("── front")
    await user.press("home")
    await user.press("j")
    assert user.lines[2].startswith("sets ")
    await user.press("k")
    assert user.lines[2].startswith("── front")
    await user.press("escape")
    assert user.lines[2].startswith("  GROUP")
    await user.press("question_mark")
    assert "escape, backspace" in user.text
    await user.press("x")
    assert "escape, backspace" not in user.text
    await user.press("q")
    assert user.app.return_code == 0


@before(states.healthy)
async def test_the_screen_follows_the_relay(user, server):
    server.state = states.silent()
    await user.sees(states.silent().groups[0].findings[0].text)
    assert "→ " in user.text


@before(states.healthy)
async def test_a_held_picture_stays_and_then_shows_what_came_meanwhile(user, server):
    await user.press("space")
    assert " FROZEN: press space to go on" in user.lines
    asked = server.asked
    server.state = states.silent()
    while server.asked < asked + 2:
        await user.pilot.pause(0.05)
    assert "silent" not in user.text
    await user.press("space")
    await user.sees("silent")
    assert "FROZEN" not in user.text


@before(states.healthy)
async def test_a_relay_that_goes_away_is_said_over_its_last_state_and_found_when_it_comes_back(user, server):
    server.stop()
    await user.sees("nothing listens there; still trying")
    assert " STALE: no answer for " in user.lines[2]
    assert user.lines[4].startswith("▶ front     OK")
    await user.press("enter")
    assert "STALE" in user.lines[2]
    server.start()
    await user.sees("── front")
    while "STALE" in user.text:
        await user.pilot.pause(0.05)


@before(states.rig)
async def test_a_group_that_a_new_file_lacks_is_said(user, server):
    await user.press("down", "enter")
    server.state = states.healthy()
    await user.sees("The relay has no group radar any more.")
    await user.press("right")
    assert user.lines[2].startswith("── front")


@before(states.healthy, states.rig)
async def test_of_several_relays_one_is_chosen_and_another_after_it(user, *relays):
    assert user.lines[0] == "2 relays answer. Which one?"
    assert f"/syncrelay  {relays[1].url}  groups: front, rear, inertial, radar" in user.lines[3]
    await user.press("down", "enter")
    await user.sees("▶ inertial  ERROR")
    await user.press("escape")
    await user.sees("Which one?")
    await user.press("up", "enter")
    await user.sees("── front")
    assert "inertial" not in user.text


@pytest.mark.parametrize("size", [(59, 24), (80, 14)])
def test_a_terminal_that_is_too_small_gets_a_sentence(size):
    shown = " ".join(at_terminal(states.rig(), size=size)).split()
    assert " ".join(shown) == f"This screen needs 60x15; this terminal has {size[0]}x{size[1]}."


@pytest.mark.parametrize("name", ["rig", "nothing", "twelve", "sixteen"])
def test_what_is_shown_fits_every_terminal(name):
    @before(states.ALL[name])
    async def look(user, *_):
        for size in ((60, 15), (200, 60)):
            await user.pilot.resize_terminal(*size)
            for key in ("enter", "escape"):
                await user.press(key)
                assert len(user.lines) == size[1]
                assert max(map(len, user.lines)) <= size[0]
                assert "Quit" in user.lines[-1]

    look()


def test_sixteen_inputs_are_told_apart_by_what_differs_in_their_names():
    lines = at_terminal(states.sixteen_inputs(), size=(80, 30))
    rows = [line.split()[0] for line in lines if line.startswith("…/")]
    assert rows == [f"…/camera_{number:02}/…" for number in range(16)]


def test_what_has_no_room_is_counted():
    assert re.fullmatch(r"… \d+ more lines: press enter", at_terminal(states.sixteen_inputs())[-2])


def test_a_bug_ends_it_and_is_handed_on():
    class Broken(TopApp):
        def action_sort(self):
            raise ZeroDivisionError

    async def look(app):
        async with app.run_test(size=_SMALL) as pilot:
            await pilot.press("s")
            await pilot.pause()

    with running(states.rig()) as server:
        app = Broken([ask(server.url)])
        with pytest.raises(ZeroDivisionError):
            asyncio.run(look(app))
    assert isinstance(app.failure, ZeroDivisionError)
