"""`syncrelay top` as a user starts it: on a terminal, without one, and where there is nothing to show."""

import os
import signal
import sys

import pytest

from tests.cli.command import run
from tests.cli.terminals import on_terminal
from tests.faults.extent import chosen
from tests.status.support.serving import running
from tests.top import states


def test_the_state_is_printed_once_as_text_of_80_columns(tmp_path):
    with running(states.rig()) as server:
        shown = run("top", "--once", "--url", server.url, folder=tmp_path)
    assert (shown.returncode, shown.stderr) == (0, "")
    lines = shown.stdout.splitlines()
    assert lines[1].startswith(f"/syncrelay at {server.url}: running, not ready, up 30 s, syncrelay")
    assert "front: OK, 10 of 10 possible sets a second, 300 sets, last just now" in lines
    assert "  latency: p50 2.56 ms, p95 9.01 ms, max 11.3 ms" in lines
    finding = states.rig().groups[1].findings[0]
    assert f"  ERROR: {finding.text}" in lines
    assert any(line.startswith("    fix: ") and (finding.suggestion or "").startswith(line[9:]) for line in lines)
    assert "  /radar/points: no publisher" in lines
    assert "    900 received, 300 in sets, 2 waiting, 598 not needed, 0 dropped" in lines
    assert max(map(len, lines)) <= 80
    assert shown.stdout.isascii()


def test_without_a_terminal_it_points_to_text(tmp_path):
    with running(states.healthy()) as server:
        shown = run("top", "--url", server.url, folder=tmp_path)
    assert (shown.returncode, shown.stdout) == (1, "")
    assert shown.stderr == (
        "syncrelay: top needs a terminal, and there is none here\n  `syncrelay top --once` prints text\n"
    )


@pytest.mark.parametrize("setting", [{"TERM": "dumb"}, {"PYTHONIOENCODING": "latin-1"}])
def test_a_terminal_that_cannot_draw_gets_a_sentence(tmp_path, setting):
    with running(states.healthy()) as server, _top(server.url, tmp_path, **setting) as top:
        assert top.wait_for_end() == 1
    assert "top cannot draw on this terminal: check TERM and LANG" in top.written
    assert "\x1b[?1049h" not in top.written


def test_on_a_terminal_it_draws_until_q_leaves_it_as_it_was_and_writes_no_colour_where_none_is_wanted(tmp_path):
    with running(states.rig()) as server, _top(server.url, tmp_path, NO_COLOR="1") as top:
        top.wait_for("other clock")
        top.press("q")
        assert top.wait_for_end() == 0
    assert top.written.count("\x1b[?1049h") == top.written.count("\x1b[?1049l") == 1
    parameters = [part.partition("m")[0].split(";") for part in top.written.split("\x1b[")]
    # All of SGR's colours but 39 and 49, the terminal's own.
    colours = {str(code) for code in [*range(30, 39), *range(40, 49), *range(90, 98), *range(100, 108)]}
    assert [codes for codes in parameters if colours & set(codes)] == []


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_leaves_the_terminal_as_it_was(tmp_path, number):
    with running(states.rig()) as server, _top(server.url, tmp_path) as top:
        top.wait_for("other clock")
        os.kill(top.pid, number)
        top.wait_for_end()
    assert top.written.count("\x1b[?1049h") == top.written.count("\x1b[?1049l") == 1


# A process learns that its terminal is gone if that is its own. nohup and many CI runners start what they run with
# SIGHUP ignored.
_ON_A_TERMINAL_OF_ITS_OWN = """
import fcntl, signal, sys, termios
signal.signal(signal.SIGHUP, signal.Handlers[sys.argv[2]])
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from syncrelay.cli import main
sys.argv = ["syncrelay", "top", "--url", sys.argv[1]]
sys.exit(main())
"""


@pytest.mark.faults
@pytest.mark.parametrize("inherited", ["SIG_DFL", "SIG_IGN"])
@pytest.mark.parametrize("after_s", chosen(short=[0.08], long=[0.0, 0.03, 0.08, 0.2, 0.6]))
def test_it_ends_with_its_terminal_however_soon_that_goes(tmp_path, after_s, inherited):
    with running(states.healthy()) as server:
        argv = [sys.executable, "-c", _ON_A_TERMINAL_OF_ITS_OWN, server.url, inherited]
        with on_terminal(argv, folder=tmp_path, environ={}) as top:
            assert top.hang_up(after_s) in {0, 1, 128 + signal.SIGHUP, -signal.SIGHUP}


def _top(url, folder, **environ):
    return on_terminal([sys.executable, "-m", "syncrelay", "top", "--url", url], folder=folder, environ=environ)
