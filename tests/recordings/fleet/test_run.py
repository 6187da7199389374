"""A task on recordings on this machine's cores: what becomes of each, and what stands in the folder at the end."""

import random
import shutil
import signal
from dataclasses import replace
from pathlib import Path
from typing import Final

import pytest

from syncrelay.recordings.fleet.job import Done, Failed, Kept
from syncrelay.recordings.fleet.ledger import LEDGER
from syncrelay.recordings.fleet.local import LocalEngine
from syncrelay.recordings.fleet.recordings import find_sources
from syncrelay.recordings.fleet.run import Others, Run
from tests.faults.extent import chosen
from tests.recordings.fleet.fleets import entries, result, tree
from tests.recordings.fleet.tasks import Obedient, attempts_of

pytestmark = pytest.mark.process


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


# What a recording's first line asks for; the outcome, what is said of it, and how often it is begun.
_KINDS: Final[dict[str, tuple[type, str, int]]] = {
    "copy": (Done, "", 1),
    "die 1": (Done, "", 2),
    "die 2": (Done, "", 3),
    "die 3": (Failed, "its worker was killed 3 times: check whether there is enough memory", 3),
    "refuse": (Failed, "is of no use", 1),
    "break": (Failed, "ZeroDivisionError", 1),
    "take 1000000000": (Failed, "takes more memory than a worker has: use fewer --jobs", 1),
    "grow": (Failed, "was changed while it was read: is it still being recorded?", 1),
}
_CHANGES: Final = ("nothing", "nothing", "content", "content", "new", "removed", "damaged", "added", "folder")
_DRAWN: Final = chosen(short=2, long=200)


class Drawn:
    """A folder of recordings that is run, changed and run again; how it was drawn says what becomes of each."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.random = random.Random(seed)
        self.bags, self.out = folder / "bags", folder / "out"
        self.bags.mkdir(parents=True)
        self.texts: dict[str, str] = {}
        self.has_result: set[str] = set()
        for name in "abcde":
            self.draw(name)

    def draw(self, name: str) -> None:
        """Write a recording anew, which then has no result of its content."""
        self.texts[name] = f"{self.random.choice(['copy', 'copy', *_KINDS])}\n{self.random.random()}"
        self.has_result.discard(name)

    def change(self) -> None:
        """Do what users and killed commands do to recordings and results."""
        for left in (".partial", ".syncrelay-killed"):
            (self.out / left / "half").mkdir(parents=True)
        for name in [*self.texts]:
            change = self.random.choice(_CHANGES)
            if change == "content":
                self.draw(name)
            elif change == "new":
                self.draw(f"{name}{self.random.randrange(10**6)}")
            elif change != "nothing" and name in self.has_result:
                self.has_result.remove(name)
                folder = result(self.out, name)
                copy = folder / "below" / "copy"
                match change:
                    case "removed":
                        copy.unlink()
                    case "damaged":
                        copy.write_text(copy.read_text().swapcase())
                    case "added":
                        (folder / "note").write_text("")
                    case "folder":
                        shutil.rmtree(folder)

    def run(self, out: str = "out") -> None:
        for former in self.bags.glob("*.attempts"):
            former.unlink()
        for name, text in self.texts.items():
            (self.bags / f"{name}.mcap").write_text(text)
        outcomes = go(self.bags, out=out, jobs=self.random.choice((1, 2, 3)))
        assert outcomes.keys() == self.texts.keys()
        for name, outcome in outcomes.items():
            kind, said, tries = _KINDS[self.texts[name].partition("\n")[0]]
            if out == "out" and name in self.has_result:
                kind, tries = Kept, 0
            assert isinstance(outcome, kind), (name, self.texts[name], outcome)
            assert attempts_of(self.bags / f"{name}.mcap") == tries
            if isinstance(outcome, Failed):
                assert said in outcome.why
                assert (outcome.is_bug, outcome.ends_all) == ("Zero" in said, False)
            else:
                self.has_result.add(name)
                assert (result(self.bags.parent / out, name) / "below" / "copy").read_text() == self.texts[name]


@pytest.mark.parametrize("seed", range(_DRAWN))
def test_what_changed_is_done_again_and_the_folder_is_that_of_one_run(seed, tmp_path):
    drawn = Drawn(tmp_path, seed)
    drawn.run()
    for _ in range(2):
        drawn.change()
        drawn.run()
    before = tree(drawn.out), (drawn.out / LEDGER).read_bytes()
    drawn.run()
    assert (tree(drawn.out), (drawn.out / LEDGER).read_bytes()) == before
    drawn.run("anew")
    assert tree(tmp_path / "anew") == before[0]


def test_a_recording_that_cannot_be_reached_keeps_its_result(bags):
    go(bags)
    sources = find_sources([str(bags)], into=bags.parent / "out")
    (bags / "b.mcap").rename(bags / "gone")
    with Run(Obedient(), sources, into=bags.parent / "out", others=Others.REFUSED) as run:
        outcomes = [each.outcome for each in run.go(LocalEngine(jobs=2)) if each is not None]
    assert sum(isinstance(outcome, Failed) for outcome in outcomes) == 1
    (bags / "gone").rename(bags / "b.mcap")
    assert set(go(bags).values()) == {Kept()}


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
