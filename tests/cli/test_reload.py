"""`syncrelay reload` as a user starts it, where there is nobody, more than one, or somebody else."""

import json
from contextlib import ExitStack

import pytest

from syncrelay.status.as_document import status_of
from tests.cli.command import run
from tests.status.support.serving import running
from tests.top import states
from tests.top.speaker import answering, speaking


@pytest.mark.parametrize("words", [["reload"], ["top", "--once"]])
def test_of_several_relays_none_is_taken_for_the_one_that_is_meant(tmp_path, words):
    state = states.rig()
    with ExitStack() as stack:
        servers = [stack.enter_context(running(state)) for _ in range(2)]
        asked = run(*words, folder=tmp_path)
    assert (asked.returncode, asked.stdout) == (1, "")
    first, *lines = asked.stderr.splitlines()
    assert first.endswith(" relays answer; choose one")
    # Others may run on this machine.
    groups = ", ".join(group.facts.name for group in state.groups)
    assert {f"  --url {server.url}   /syncrelay: {groups}" for server in servers} <= set(lines)


def test_a_relay_that_ends_once_it_is_found_is_gone(tmp_path):
    whole = b"HTTP/1.1 200 OK\r\n\r\n" + status_of(states.healthy()).as_json()
    speeches = iter([[whole]])
    with speaking(lambda: iter(next(speeches, []))) as url:
        asked = run("reload", "--url", url, folder=tmp_path)
    assert (asked.returncode, asked.stdout) == (1, "")
    assert (
        asked.stderr == f"syncrelay: the relay at {url} is gone: the connection closed before the answer was complete\n"
    )


@pytest.mark.parametrize("told", [{}, {"pid": 0}, {"pid": -1}, {"pid": 1}, {"pid": 2**70}])
def test_what_is_no_relay_here_gets_no_signal(tmp_path, told):
    state = status_of(states.healthy()).as_dict()
    del state["relay"]["pid"]
    state["relay"] |= told
    with answering(json.dumps(state).encode()) as url:
        asked = run("reload", "--url", url, folder=tmp_path)
    assert (asked.returncode, asked.stdout) == (1, "")
    assert asked.stderr.startswith(f"syncrelay: process {told.get('pid', 0)} is not the relay: it runs in a container")
