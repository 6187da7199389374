"""Stretches of a recording, put together, are one pass: every set, drop and count, wherever it is cut."""

import random
from itertools import product
from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from syncrelay.config import load_text
from syncrelay.config.policies import GROUP_MODELS
from syncrelay.errors import BagError
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.recording import AFTER_ALL
from syncrelay.recordings.bag.stretches import Stretch, cut, cut_at, lead_in
from tests.recordings.bag.stretch_tasks import Stretches, one_pass
from tests.recordings.bag.test_driving import Made
from tests.ros.cdr_messages import VECTOR
from tests.ros.configs import config, inputs
from tests.ros.streams import BEGIN, MS

_TOPICS = ("/a", "/b", "/c")
_SECOND = 1000 * MS
_KEYS = {
    "exact_time": {},
    "approximate_time": {"slop": "20ms"},
    "approximate_time_eager": {"slop": "20ms"},
    "approximate_epsilon_time": {"slop": "20ms"},
    "latest_time": {"trigger": "/a", "max_age": "150ms"},
    "equal_key": {"key": "header.frame_id"},
}
every_policy = pytest.mark.parametrize("policy", _KEYS)


def test_every_policy_of_a_file_is_among_those_tested():
    assert {get_args(model.model_fields["policy"].annotation)[0] for model in GROUP_MODELS} == set(_KEYS)


@st.composite
def texts(draw, policy):
    topics = inputs(dict.fromkeys(_TOPICS, VECTOR))
    keys = {"policy": policy, "topics": topics, "queue_size": draw(st.sampled_from((1, 2, 5, 10))), **_KEYS[policy]}
    keys["restamp"] = draw(st.sampled_from(["none", "earliest", "/b"]))
    keys["every"] = draw(st.sampled_from((1, 1, 1, 2, 3)))
    if draw(st.integers(0, 4)) == 0:
        keys["max_rate"] = "5 Hz"
    if policy == "latest_time":
        keys["trigger"] = draw(st.sampled_from(("/a", "10 Hz", "30 Hz")))
        # As long as max_wait asks for.
        keys["queue_size"] = 10 if "Hz" in keys["trigger"] else keys["queue_size"]
        topics[2]["required"] = draw(st.booleans())
        if draw(st.booleans()):
            del keys["max_age"]
    if draw(st.booleans()):
        keys["max_wait"] = f"{draw(st.integers(0, 200))}ms"
        topics[2]["required"] = draw(st.booleans())
    if policy != "equal_key":
        topics[1]["offset"] = f"{draw(st.sampled_from((0, -12, 30)))}ms"
    if draw(st.integers(0, 5)) == 0 and policy not in ("equal_key", "exact_time"):
        topics[1]["stamp"] = "receive"
    if "Hz" in keys.get("trigger", "") and draw(st.booleans()):
        keys["restamp"] = "trigger"
    plain = {"policy": policy, "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR)), **_KEYS[policy]}
    return config({"front": keys, "back": plain})


def drive(seed, seconds, trouble, jitter):
    """Three topics of 10, 10 and 4 Hz; `trouble` of all messages are late, lost, doubled, in a burst or unreadable."""
    chance = random.Random(seed)
    rows: list[tuple] = []
    for index, period in enumerate((100, 100, 250)):
        for number in range(seconds * 1000 // period):
            stamp = BEGIN + number * period * MS + round(chance.uniform(-jitter, jitter) * MS)
            row = (index, stamp, stamp + 5 * MS, f"frame_{number * period // 100}")
            rows += _troubled(row, chance) if chance.random() < trouble else [row]
    if chance.random() < trouble:
        rows = _jumped(rows, chance)
    return Made(sorted(rows, key=lambda row: row[2]))


def _troubled(row, chance):
    index, stamp, received, frame = row
    return chance.choice(
        [
            [],
            [(index, stamp, received + chance.randrange(400) * MS, frame)],
            [row, (index, stamp, received + chance.randrange(2) * 30 * MS, frame)],
            [(index, None, received, frame)],
            [(index, 0, received, frame)],
            # All of a second at once.
            [(index, stamp, received // _SECOND * _SECOND + _SECOND, frame)],
            [(index, stamp - 3 * _SECOND, received, frame)],
        ]
    )


def _jumped(rows, chance):
    """The clock of all stamps falls by some seconds, or there is a gap: nothing for some seconds."""
    at = BEGIN + chance.randrange(1, 6) * _SECOND
    if chance.random() < 0.5:
        return [row for row in rows if not at <= row[2] < at + 2 * _SECOND]
    return [
        (index, stamp - 4 * _SECOND if stamp and received > at else stamp, received, frame)
        for index, stamp, received, frame in rows
    ]


def borders_of(recording):
    """Some borders: anywhere, at a message, just before or behind one, and long before all."""
    times = sorted({row[2] for row in recording.rows} or {BEGIN})
    near = st.builds(lambda time, off: time + off, st.sampled_from(times), st.sampled_from((-1, 0, 1)))
    anywhere = st.integers(times[0] - _SECOND, times[-1])
    return st.lists((near | anywhere | st.just(5)).map(lambda time: min(time, recording.end)), max_size=6)


@every_policy
@given(data=st.data())
def test_stretches_are_one_pass_wherever_a_recording_is_cut(policy, data):
    seed, seconds = data.draw(st.integers(0, 10**6)), data.draw(st.integers(1, 7))
    recording = drive(seed, seconds, data.draw(st.sampled_from((0, 0.02, 0.3))), data.draw(st.sampled_from((0, 4, 40))))
    text = data.draw(texts(policy))
    stretches = cut_at(
        data.draw(borders_of(recording)),
        lead_in_ns=data.draw(st.sampled_from((0, 1, 50 * MS, _SECOND, 9 * _SECOND))),
        opening_end=data.draw(st.sampled_from((0, BEGIN + 300 * MS, BEGIN + 3 * _SECOND))),
    )
    assert Stretches(lambda: recording, text).joined(stretches) == one_pass(lambda: recording, text)


_MORE = [{}, {"max_wait": "90ms"}, {"max_rate": "7 Hz"}]


@pytest.mark.parametrize(
    ("policy", "more"),
    [*product(_KEYS, _MORE), *(("latest_time", {"trigger": "10 Hz", **more}) for more in _MORE)],
    ids=str,
)
def test_a_lead_in_makes_it_needless_to_replay_a_stretch_of_a_healthy_drive_again(policy, more):
    recording = drive(1, 20, 0, 0 if policy == "exact_time" else 4)
    text = config(
        {"front": {"policy": policy, "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR)), **_KEYS[policy], **more}}
    )
    stretches = cut(recording, length_ns=5 * _SECOND, lead_in_ns=2 * _SECOND)
    task = Stretches(lambda: recording, text)
    joined = task.joined(stretches)
    assert joined == one_pass(lambda: recording, text)
    assert len(stretches) == 4
    assert joined[1][0][1] > 100
    assert task.redone == []


_THINNED = {"policy": "approximate_time", "slop": "20ms", "every": 3}


def test_without_a_look_at_the_states_the_sets_would_be_others():
    recording = drive(1, 12, 0, 4)
    text = config({"front": {**_THINNED, "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}})
    stretches = cut(recording, length_ns=4 * _SECOND, lead_in_ns=_SECOND)
    whole, _ = one_pass(lambda: recording, text)
    task = Stretches(lambda: recording, text)
    assert all(task.run(stretch).stretch == stretch for stretch in stretches)
    assert task.left(stretches) != whole
    assert task.joined(stretches)[0] == whole
    assert task.redone


def test_the_opening_has_what_was_sent_only_once():
    """As a latched message that serves all triggers of a drive, however late."""
    rows = [(1, BEGIN, BEGIN, ""), *((0, BEGIN + n * 100 * MS, BEGIN + n * 100 * MS, "") for n in range(1, 100))]
    recording = Made(rows)
    keys = {"policy": "latest_time", "trigger": "/a", "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}
    text = config({"front": keys})
    for opening_end, redone in ((BEGIN + _SECOND, 0), (0, 1)):
        stretches = cut_at([BEGIN + 5 * _SECOND], lead_in_ns=_SECOND, opening_end=opening_end)
        task = Stretches(lambda: recording, text)
        joined = task.joined(stretches)
        assert joined == one_pass(lambda: recording, text)
        assert joined[1][0][1] == 99
        assert len(task.redone) == redone


def test_what_waits_when_a_stretch_goes_on_leaves_when_it_is_due():
    """/c is optional and sends nothing: set 39, which passes, waits from 3.905 s to 3.995 s, over the border."""
    recording = drive(1, 10, 0, 0)
    recording.rows = [row for row in recording.rows if row[0] < 2]
    topics = inputs(dict.fromkeys(_TOPICS, VECTOR))
    topics[2]["required"] = False
    text = config({"front": {"policy": "exact_time", "max_wait": "90ms", "every": 3, "topics": topics}})
    task = Stretches(lambda: recording, text)
    stretches = cut_at([BEGIN + 3950 * MS], lead_in_ns=1100 * MS)
    assert task.joined(stretches) == one_pass(lambda: recording, text)
    assert task.redone == [*stretches[1:]]
    first = next(left for left in task.left(stretches[1:])["front"] if left[1] is None)
    assert first[2] == BEGIN + 3995 * MS


def test_a_stretch_that_goes_on_reads_nothing_before_it():
    recording, begins = drive(1, 10, 0, 0), []
    batches = recording.batches

    def noted(channels, *, begin, end):
        begins.append(begin)
        return batches(channels, begin=begin, end=end)

    recording.batches = noted
    text = config(
        {"front": {"policy": "equal_key", **_KEYS["equal_key"], "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}}
    )
    task = Stretches(lambda: recording, text)
    first, second = cut_at([BEGIN + 5 * _SECOND], lead_in_ns=_SECOND, opening_end=BEGIN + _SECOND)
    before = task.run(first)
    begins.clear()
    task.run(second)
    assert begins == [0, second.read_from]
    begins.clear()
    task.run(second, before)
    assert begins == [second.begin]


def test_only_groups_in_another_state_make_a_stretch_be_replayed_again():
    recording = drive(1, 12, 0, 4)
    pair = inputs(dict.fromkeys(_TOPICS[:2], VECTOR))
    text = config(
        {
            "plain": {"policy": "approximate_time", "slop": "20ms", "topics": pair},
            "thinned": {**_THINNED, "topics": pair},
        }
    )
    first, second = (
        Stretches(lambda: recording, text).run(each) for each in cut_at([BEGIN + 6 * _SECOND], lead_in_ns=_SECOND)
    )
    assert [a.exit == b.entry for a, b in zip(first.groups, second.groups, strict=True)] == [True, False]
    assert not second.follows(first)


def test_what_follows_a_stretch_begins_where_it_ends():
    recording = drive(1, 12, 0, 4)
    text = config(
        {"front": {"policy": "approximate_time", "slop": "20ms", "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}}
    )
    task = Stretches(lambda: recording, text)
    first, second, third = (task.run(each) for each in cut(recording, length_ns=4 * _SECOND, lead_in_ns=_SECOND))
    assert second.follows(first)
    assert third.follows(second)
    assert not third.follows(first)


def test_a_stretch_follows_only_the_one_before_even_where_nothing_was_received():
    recording = drive(1, 1, 0, 0)
    text = config({"front": {"policy": "exact_time", "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}})
    first, second, third = map(Stretches(lambda: recording, text).run, cut_at([5, 6], lead_in_ns=0))
    assert first.groups[0].exit == third.groups[0].entry
    assert second.follows(first)
    assert third.follows(second)
    assert not third.follows(first)


@pytest.mark.parametrize("off", [-1, 0, 1])
def test_what_is_due_at_a_border_leaves_behind_it_and_what_was_due_before_it_before(off):
    """/c is optional and sends nothing: each set leaves 90 ms after it was complete."""
    recording = drive(1, 10, 0, 0)
    recording.rows = [row for row in recording.rows if row[0] < 2]
    topics = inputs(dict.fromkeys(_TOPICS, VECTOR))
    topics[2]["required"] = False
    keys = {"policy": "exact_time", "max_wait": "90ms", "topics": topics}
    border = BEGIN + 4 * _SECOND + 95 * MS + off
    task = Stretches(lambda: recording, config({"front": keys}))
    stretches = cut_at([border], lead_in_ns=_SECOND)
    assert task.joined(stretches) == one_pass(lambda: recording, config({"front": keys}))
    assert task.redone == []
    sets_before = [left for left in task.left(stretches[:1])["front"] if left[1] is None]
    assert [left[2] for left in sets_before][-1] == border - off - (0 if off == 1 else 100 * MS)


def test_a_recording_is_cut_into_equal_stretches_that_are_all_of_it():
    recording = drive(1, 10, 0, 0)
    stretches = cut(recording, length_ns=3 * _SECOND, lead_in_ns=_SECOND)
    assert [each.begin for each in stretches] == [
        0,
        *(recording.begin + part * (recording.end - recording.begin) // 4 for part in (1, 2, 3)),
    ]
    assert [each.end for each in stretches] == [*(each.begin for each in stretches[1:]), AFTER_ALL]
    assert [each.begin - each.read_from for each in stretches] == [0, _SECOND, _SECOND, _SECOND]
    assert {each.opening_end for each in stretches} == {recording.begin + _SECOND}
    assert [each.is_last for each in stretches] == [False, False, False, True]
    assert cut(Made([]), length_ns=_SECOND, lead_in_ns=0) == (Stretch(0, AFTER_ALL, 0, 0),)
    assert len(cut(recording, length_ns=1, lead_in_ns=0)) == 9_999
    for wrong in ({"length_ns": 0, "lead_in_ns": 0}, {"length_ns": 1, "lead_in_ns": -1}):
        with pytest.raises(ValueError, match="must be"):
            cut(recording, **wrong)


def test_the_lead_in_is_longer_for_groups_that_hold_messages_longer():
    recording = drive(1, 1, 0, 0)
    topics = inputs(dict.fromkeys(_TOPICS[:2], VECTOR))

    def lead(**keys):
        text = config({"front": {"policy": "approximate_time", "slop": "20ms", "topics": topics, **keys}})
        return lead_in(bind(load_text(text), recording))

    plain = lead()
    assert 10 * _SECOND < plain < 20 * _SECOND
    assert lead(max_wait="3s") == plain + 6 * _SECOND
    assert lead(slop="1020ms") == plain + 2 * _SECOND
    assert lead(queue_size=110) == plain + 10 * _SECOND


def test_a_stretch_after_the_end_is_refused():
    recording = drive(1, 1, 0, 0)
    text = config({"front": {"policy": "exact_time", "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}})
    with pytest.raises(ValueError, match="begins after the recording's end"):
        Stretches(lambda: recording, text).run(Stretch(recording.end + 1, AFTER_ALL, 0))


def test_messages_that_are_not_in_the_order_of_receipt_are_refused_in_stretches_and_not_as_a_whole():
    rows = [(0, BEGIN, BEGIN + 9, "x"), (0, BEGIN + 1, BEGIN + 5, "x")]
    recording = Made(rows)
    text = config(
        {"front": {"policy": "approximate_time", "slop": "20ms", "topics": inputs(dict.fromkeys(_TOPICS[:2], VECTOR))}}
    )
    task = Stretches(lambda: recording, text)
    assert task.joined(cut_at([], lead_in_ns=0)) == one_pass(lambda: recording, text)
    with pytest.raises(BagError) as refused:
        task.run(Stretch(BEGIN, AFTER_ALL, BEGIN))
    assert str(refused.value) == (
        f"a message of /a that was received at {BEGIN + 5} comes behind one received at {BEGIN + 9}, expected the order"
        " of receipt: read the recording as a whole, not in stretches"
    )
