"""A task on recordings on this machine's cores: what becomes of each, and what stands in the folder at the end."""

import signal
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

from syncrelay.errors import SyncRelayError
from syncrelay.recordings.fleet.job import Done, Failed, Kept
from syncrelay.recordings.fleet.ledger import State, read_ledger
from syncrelay.recordings.fleet.local import LocalEngine
from syncrelay.recordings.fleet.recordings import find_sources
from syncrelay.recordings.fleet.run import Others, Run
from tests.recordings.fleet.fleets import entries, result, tree
from tests.recordings.fleet.tasks import Obedient, attempts_of


@pytest.fixture
def bags(tmp_path):
    (tmp_path / "bags").mkdir()
    for name in ("a", "b", "c", "d"):
        (tmp_path / "bags" / f"{name}.mcap").write_text(f"content of {name}")
    return tmp_path / "bags"


def go(bags, *, out="out", option=0, jobs=2, others=Others.REFUSED, only="*.mcap", time_limit=None):
    """Run the task; the outcome of each recording by its name."""
    into = bags.parent / out
    sources = find_sources([f"{bags}/{only}"], into=into)
    with Run(Obedient(option), sources, into=into, others=others, time_limit=time_limit) as run:
        ended = [each for each in run.go(LocalEngine(jobs=jobs, memory=_held() + 500_000_000)) if each is not None]
    assert not (into / ".partial").exists()
    return {each.job.source.name.rpartition("-")[0]: each.outcome for each in ended}


def _held():
    """The bytes that a worker has from the start: those of this process, which grows with the tests that it ran."""
    (line,) = [each for each in Path("/proc/self/status").read_text().splitlines() if each.startswith("VmData:")]
    return int(line.split()[1]) * 1024


def test_each_recording_gets_a_folder_and_a_line(bags):
    assert {type(outcome) for outcome in go(bags).values()} == {Done}
    out = bags.parent / "out"
    assert (result(out, "a") / "below" / "copy").read_text() == "content of a"
    assert {name: entry["facts"] for name, entry in entries(out).items()} == {name: {"letters": 12} for name in "abcd"}


def test_two_workers_leave_what_one_leaves(bags):
    go(bags, out="one", jobs=1)
    go(bags, out="two", jobs=2)
    assert tree(bags.parent / "one") == tree(bags.parent / "two")


def test_the_same_run_again_does_nothing(bags):
    go(bags)
    before = (bags.parent / "out" / "_ledger.jsonl").read_bytes()
    assert set(go(bags).values()) == {Kept()}
    assert (bags.parent / "out" / "_ledger.jsonl").read_bytes() == before
    assert {attempts_of(bags / f"{name}.mcap") for name in "abcd"} == {1}


def _content_changed(bags, _out):
    (bags / "b.mcap").write_text("content of B")


def _result_removed(_bags, out):
    (result(out, "b") / "below" / "copy").unlink()


def _result_damaged(_bags, out):
    (result(out, "b") / "below" / "copy").write_text("content of 8")


def _result_added_to(_bags, out):
    (result(out, "b") / "note").write_text("")


def _whole_folder_removed(_bags, out):
    result(out, "b").rename(out.parent / "elsewhere")


@pytest.mark.parametrize(
    "change", [_content_changed, _result_removed, _result_damaged, _result_added_to, _whole_folder_removed]
)
def test_only_what_is_missing_or_changed_is_done_again(change, bags):
    go(bags)
    change(bags, bags.parent / "out")
    outcomes = go(bags)
    assert [name for name, outcome in outcomes.items() if isinstance(outcome, Done)] == ["b"]
    go(bags, out="anew")
    assert tree(bags.parent / "out") == tree(bags.parent / "anew")


def test_new_recordings_join_those_that_are_done(bags):
    assert go(bags, only="[ab].mcap").keys() == {"a", "b"}
    outcomes = go(bags)
    assert {name for name, outcome in outcomes.items() if isinstance(outcome, Kept)} == {"a", "b"}


def test_a_faulty_recording_is_told_and_tried_again_next_time(bags):
    (bags / "b.mcap").write_text("refuse")
    outcomes = go(bags)
    assert outcomes["b"] == Failed("b.mcap: is of no use", outcomes["b"].content)
    assert [type(outcomes[name]) for name in "acd"] == [Done] * 3
    assert entries(bags.parent / "out")["b"]["error"] == "b.mcap: is of no use"
    go(bags)
    assert attempts_of(bags / "b.mcap") == 2
    (bags / "b.mcap").write_text("mended")
    assert isinstance(go(bags)["b"], Done)
    assert {entry.state for entry in read_ledger(bags.parent / "out")} == {State.DONE}


def test_a_recording_that_has_become_faulty_keeps_no_result_of_what_it_was(bags):
    go(bags)
    (bags / "b.mcap").write_text("refuse")
    go(bags)
    assert sorted(path.name[0] for path in (bags.parent / "out").iterdir()) == ["_", "a", "c", "d"]


def test_a_recording_that_cannot_be_reached_keeps_its_result(bags):
    go(bags)
    sources = find_sources([str(bags)], into=bags.parent / "out")
    (bags / "b.mcap").rename(bags / "gone")
    with Run(Obedient(), sources, into=bags.parent / "out", others=Others.REFUSED) as run:
        outcomes = [each.outcome for each in run.go(LocalEngine(jobs=2)) if each is not None]
    assert sum(isinstance(outcome, Failed) for outcome in outcomes) == 1
    (bags / "gone").rename(bags / "b.mcap")
    assert set(go(bags).values()) == {Kept()}


def test_a_bug_is_that_recordings_alone(bags):
    (bags / "b.mcap").write_text("break")
    outcomes = go(bags)
    assert outcomes["b"].is_bug
    assert "ZeroDivisionError" in outcomes["b"].why
    assert [type(outcomes[name]) for name in "acd"] == [Done] * 3


def test_a_full_disk_is_no_recordings_fault(bags):
    (bags / "b.mcap").write_text("fill")
    outcome = go(bags)["b"]
    assert outcome.ends_all
    assert "out: cannot be written: No space left on device" in outcome.why
    assert "b" not in entries(bags.parent / "out")


@pytest.mark.parametrize(("deaths", "kind"), [(1, Done), (2, Done), (3, Failed)])
def test_a_worker_that_dies_costs_its_own_recording_a_try(deaths, kind, bags):
    (bags / "b.mcap").write_text(f"die {deaths}")
    outcomes = go(bags)
    assert isinstance(outcomes["b"], kind)
    assert attempts_of(bags / "b.mcap") == min(3, deaths + 1)
    assert [type(outcomes[name]) for name in "acd"] == [Done] * 3
    assert {attempts_of(bags / f"{name}.mcap") for name in "acd"} == {1}
    if kind is Failed:
        assert "its worker was killed 3 times: check whether there is enough memory" in outcomes["b"].why


def test_a_recording_that_takes_too_much_memory_fails_alone(bags):
    (bags / "b.mcap").write_text("take 1000000000")
    (bags / "c.mcap").write_text("take 10000000")
    outcomes = go(bags)
    assert "takes more memory than a worker has: use fewer --jobs" in outcomes["b"].why
    assert [type(outcomes[name]) for name in "acd"] == [Done] * 3


@pytest.mark.parametrize("ignored", [False, True])
def test_a_recording_that_takes_too_long_is_given_up_alone(ignored, bags):
    (bags / "b.mcap").write_text("hang")
    former = signal.signal(signal.SIGALRM, signal.SIG_IGN if ignored else signal.SIG_DFL)
    try:
        outcomes = go(bags, time_limit=300_000_000)
    finally:
        signal.signal(signal.SIGALRM, former)
    assert "b.mcap: not done within 0.3 s: check it, or give it longer" in outcomes["b"].why
    assert attempts_of(bags / "b.mcap") == 1
    assert [type(outcomes[name]) for name in "acd"] == [Done] * 3
    assert entries(bags.parent / "out")["b"]["state"] == "failed"


def test_a_large_recording_has_longer(bags):
    into = bags.parent / "out"
    with Run(Obedient(), find_sources([f"{bags}/a.mcap"], into=into), into=into, others=Others.REFUSED) as run:
        (job,) = run.jobs
    assert [job.limit_of(size) / 10**9 for size in (0, 10**6, 10**9)] == [600, 610, 10_600]
    assert replace(job, time_limit=7).limit_of(10**9) == 7


def test_a_recording_that_is_still_written_is_not_done(bags):
    (bags / "b.mcap").write_text("grow")
    assert "was changed while it was read: is it still being recorded?" in go(bags)["b"].why


def test_another_option_needs_leave_to_replace(bags):
    go(bags)
    before = tree(bags.parent / "out")
    with pytest.raises(SyncRelayError, match=r"out: holds results of other options: name another folder, or .*--overw"):
        go(bags, option=1)
    assert tree(bags.parent / "out") == before


def test_replacing_leaves_nothing_of_what_was_there(bags):
    go(bags)
    go(bags, option=1, others=Others.REPLACED, only="[ab].mcap")
    go(bags, option=1, out="anew", only="[ab].mcap")
    out = bags.parent / "out"
    found = {name: entry for name, entry in entries(out).items() if entry["state"] != "removed"}
    assert found == entries(bags.parent / "anew")
    assert {path.name[0] for path in out.iterdir()} == {"_", "a", "b"}
    # That it was replaced is done.
    assert set(go(bags, option=1, only="[ab].mcap").values()) == {Kept()}


def test_what_a_killed_run_left_is_removed_at_the_next_start(bags):
    go(bags, only="a.mcap")
    left = bags.parent / "out" / ".partial" / "b-0.1"
    left.mkdir(parents=True)
    (left / "half").write_text("ha")
    go(bags)
    go(bags, out="anew")
    assert tree(bags.parent / "out") == tree(bags.parent / "anew")


def test_closing_a_run_ends_its_workers_and_the_next_goes_on(bags):
    into = bags.parent / "out"
    sources = find_sources([str(bags)], into=into)
    with (
        Run(Obedient(), sources, into=into, others=Others.REFUSED) as run,
        closing(run.go(LocalEngine(jobs=1))) as ended,
    ):
        next(each for each in ended if each is not None)
    outcomes = go(bags)
    assert sum(isinstance(outcome, Kept) for outcome in outcomes.values()) == 1
