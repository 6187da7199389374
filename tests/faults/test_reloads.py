"""A file that changes without end, rightly and wrongly, costs the groups that stay nothing."""

import random
import signal
import time

import pytest

from tests.faults.changes import change
from tests.faults.extent import chosen
from tests.faults.flow import MS, Report, Rig, Witness, accounts
from tests.faults.vitals import descriptors, memory_mb
from tests.ros.cdr_messages import NS_PER_SECOND, VECTOR
from tests.ros.configs import LOSSLESS, ROOMY, inputs
from tests.ros.processes import wait_until
from tests.ros.reloaded import ReloadedFile
from tests.ros.stage import BACKEND, BACKENDS, Stage
from tests.ros.status import ANY_PORT, status

pytestmark = [pytest.mark.ros, pytest.mark.faults]

_HZ = 100
_RELOADS = chosen(short=8, long=500)
_TOPICS = ("/camera", "/lidar")
_FRONT = {
    "policy": "approximate_time",
    "slop": f"{4 * MS}ns",
    "queue_size": ROOMY,
    "restamp": "earliest",
    "topics": inputs(dict.fromkeys(_TOPICS, VECTOR), qos=LOSSLESS),
}


@pytest.mark.timeout(chosen(short=600, long=3600))
@pytest.mark.parametrize("backend", chosen(short=[BACKEND], long=BACKENDS))
def test_a_group_that_stays_loses_and_doubles_nothing_whatever_files_come(stage: Stage, figures):
    file, witness, began = _begun(stage)
    relay = file.relay
    chance = random.Random(3)
    taken = refused = 0
    vitals = {}
    for number in range(_RELOADS):
        text, is_right = change(chance, {"front": _FRONT}, _TOPICS, metrics=ANY_PORT)
        taken, refused = taken + is_right, refused + (not is_right)
        _reload(file, text, taken=taken, refused=refused)
        vitals[number] = descriptors(relay.pid), memory_mb(relay.pid)
    file.reload(front=_FRONT)
    ended = _ended(witness, began)
    n_sets = ended.sets - began.sets
    # The source leaves no number out: of each there is a set.
    assert n_sets == _number(ended) - _number(began)
    assert ended.faults == []
    wait_until(lambda: all(each["received"] >= n_sets for each in accounts(relay)), "the counts of the same group")
    assert "a bug in syncrelay" not in relay.stderr
    assert "the relay cannot" not in relay.stderr
    early, late = vitals[_RELOADS // 4], vitals[_RELOADS - 1]
    assert late[0] <= early[0] + 20
    assert late[1] <= early[1] + 30
    figures(
        f"{_RELOADS} reloads at {_HZ} Hz ({stage.environment['SYNCRELAY_RECEIVE']}): {taken} files taken, {refused}"
        f" refused; {n_sets} sets of the group that stayed, none lost or doubled; {early[0]} descriptors and"
        f" {early[1]:.0f} MB after a quarter of them, {late[0]} and {late[1]:.0f} MB after all"
    )


def _begun(stage: Stage) -> tuple[ReloadedFile, Witness, Report]:
    """A relay whose group gives sets: its file, who watches them, and what that has seen by now."""
    rig, file = Rig(stage, topics=_TOPICS), ReloadedFile(stage, front=_FRONT)
    witness, source = rig.witness(), rig.source()
    source.match()
    source.pace(_HZ)
    return file, witness, witness.wait_for_sets(_HZ)


def _ended(witness: Witness, began: Report) -> Report:
    """What it has seen with a set that left after now, and of each message since it began its partner but of the last.

    What came on one output before the other was heard of has none.
    """
    seen = witness.wait_for_set_after(time.time_ns())

    def is_paired() -> bool:
        nonlocal seen
        seen = witness.report()
        return seen.unpaired <= began.unpaired + 1

    witness.process.wait_until(is_paired, "the partners of all messages")
    return seen


def _number(seen: Report) -> int:
    """Which of all sets the last one is, by its stamp."""
    assert seen.last_set is not None
    return seen.last_set * _HZ // NS_PER_SECOND


def _reload(file: ReloadedFile, text: str, *, taken: int, refused: int) -> None:
    """Have the relay read this text, and wait until it has so many files taken and refused."""
    file.write(text)
    file.relay.send(signal.SIGHUP)

    def read() -> bool:
        told = status(file.relay)["relay"]
        return bool(told["reloads"] + told["refused_reloads"] == taken + refused)

    file.relay.wait_until(read, "the file to be read")
    told = status(file.relay)["relay"]
    assert (told["reloads"], told["refused_reloads"]) == (taken, refused), (told["reload_error"], text)
