"""Manifests on their way out: each set's is published once, in order, whoever publishes, and before its outlet ends."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any, NamedTuple

import pytest

from syncrelay.dataflow import manifest_queue
from syncrelay.dataflow.backend import PublishError
from syncrelay.dataflow.bugs import Bugs
from syncrelay.dataflow.group import GroupRelay
from syncrelay.dataflow.manifest import ManifestWriter
from syncrelay.dataflow.manifest_queue import GroupManifests, ManifestQueue
from tests.dataflow.payloads import Named, Outlet, connect, group_of
from tests.ros.cdr_messages import VECTOR, vector
from tests.ros.manifests import ERROR, OK, read
from tests.ros.processes import wait_until
from tests.ros.streams import BEGIN, MS


class _Held(NamedTuple):
    name: bytes
    received: int = 0

    def content(self) -> bytes:
        return self.name


class _Told:
    """A group of two inputs whose sets are told."""

    def __init__(self, queue: ManifestQueue, name: str = "front", **keys: Any) -> None:
        self.group = group_of(name=name, **{"topics": ["/a", "/b"], **keys})
        self.outlets, self.manifest = (Outlet(), Outlet()), Outlet()
        topics = [("/a", f"/{name}/a"), ("/b", f"/{name}/b")]
        writer = ManifestWriter(self.group.config, node="/syncrelay", topics=topics, bundle=None)
        self.manifests: GroupManifests = queue.begin(name, writer, self.manifest)
        self.group.tell_sets(self.manifests)
        connect(self.group, self.outlets)
        self._stamp = BEGIN

    def feed_sets(self, count: int = 1) -> None:
        for _ in range(count):
            self._stamp += MS
            for index in range(2):
                self.group.flow.receive(index, Named(b"", self._stamp), self._stamp)

    @property
    def numbers(self) -> list[int]:
        """The numbers of the sets that were told."""
        return [read(content).number for content in self.manifest.log]


@pytest.fixture
def queue() -> ManifestQueue:
    return ManifestQueue(bugs=Bugs())


@contextmanager
def _running(queue: ManifestQueue) -> Iterator[ThreadPoolExecutor]:
    with ThreadPoolExecutor() as threads:
        running = threads.submit(queue.run)
        try:
            yield threads
        finally:
            queue.stop()
        running.result()


@pytest.mark.parametrize(("has_header", "expected"), [(True, [7, 1000]), (False, [900, 1000])])
def test_what_is_matched_by_another_time_leaves_with_its_header(queue, has_header, expected):
    of_device = {"topic": "/a", "type": VECTOR, "clock": "device"}
    told = _Told(queue, topics=[of_device, "/b"], policy="approximate_time_eager", slop="50s")
    for index, outlet in enumerate(told.outlets):
        told.group.connect(index, outlet, restamped=has_header)
    told.group.flow.receive(0, _Held(vector(7)), 900)
    told.group.flow.receive(1, _Held(vector(999)), 1000)
    queue.publish()
    (manifest,) = map(read, told.manifest.log)
    assert [each.stamp for each in manifest.inputs] == expected
    assert [each.original_stamp for each in manifest.inputs] == [900, 1000]


def test_what_could_not_be_published_is_told_as_it_was_when_the_set_left(queue):
    told = _Told(queue)
    for refusal in (None, PublishError("no room"), None):
        told.outlets[1].refusal = refusal
        told.feed_sets()
    queue.publish()
    first, refused, last = map(read, told.manifest.log)
    assert (first.level, first.message, last.level, last.message) == (OK, "complete", OK, "complete")
    assert (refused.level, refused.message) == (ERROR, "1 of 2 not published")
    assert (refused.inputs[1].level, refused.inputs[1].message, refused.inputs[1].sequence) == (ERROR, "no room", 0)
    assert [[each.sequence for each in one.inputs] for one in (first, refused, last)] == [[1, 1], [2, 0], [3, 2]]


def test_sets_are_counted_while_nobody_listens(queue):
    told = _Told(queue)
    for heard in (True, False, True):
        told.manifest.heard = heard
        queue.look()
        told.feed_sets(2)
    queue.publish()
    assert told.numbers == [1, 2, 5, 6]


def test_a_manifest_that_cannot_be_published_is_said_once_and_costs_no_set(queue, caplog):
    told = _Told(queue)
    for refusal in (*[PublishError("no room")] * 2, None, PublishError("no room")):
        told.manifest.refusal = refusal
        told.feed_sets()
        queue.publish()
    assert [outlet.sent for outlet in told.outlets] == [4, 4]
    assert told.numbers == [3]
    assert [record.message for record in caplog.records] == ["front: a manifest could not be published: no room"] * 2


def test_of_a_set_with_a_common_stamp_it_is_told_which_outputs_have_it(queue):
    told = _Told(queue, policy="approximate_time_eager", slop="20ms", restamp="latest")
    told.group.connect(1, told.outlets[1], restamped=True)
    for index, ms in ((0, 4), (1, 9), (0, 29), (1, 24)):
        told.group.flow.receive(index, Named(b"", BEGIN), BEGIN + ms * MS)
    queue.publish()
    first, second = map(read, told.manifest.log)
    assert [each.common_stamp for each in (first, second)] == [BEGIN + 9 * MS, BEGIN + 29 * MS]
    stamps = [[each.stamp for each in manifest.inputs] for manifest in (first, second)]
    assert stamps == [[BEGIN + ms * MS for ms in left] for left in ((4, 9), (29, 29))]


def test_a_bug_costs_one_manifest_and_no_set(queue, caplog):
    told = _Told(queue)
    told.feed_sets()
    told.manifest.refusal = ZeroDivisionError("a bug")
    queue.publish()
    told.manifest.refusal = None
    told.feed_sets()
    queue.publish()
    assert told.group.failure is None
    assert told.numbers == [2]
    (record,) = caplog.records
    assert "publishing a manifest of front" in record.message


def test_each_is_published_once_and_in_order_whoever_publishes(queue):
    told = [_Told(queue, name) for name in ("front", "rear")]

    def feed() -> None:
        for each in told * 100:
            each.feed_sets(10)

    with _running(queue) as threads:
        fed = threads.submit(feed)
        while not fed.done():
            queue.publish()
        fed.result()
    assert [each.numbers for each in told] == [list(range(1, 1001))] * 2


def test_the_end_of_a_group_leaves_nothing_to_publish(queue):
    ended: list[_Told] = []
    with _running(queue):
        stays = _Told(queue, "stays")
        for _ in range(100):
            ends = _Told(queue)
            for _ in range(5):
                ends.feed_sets()
                stays.feed_sets()
            queue.keep([stays.manifests])
            ends.manifest.ended = True
            ended.append(ends)
    assert [each.numbers for each in ended] == [[1, 2, 3, 4, 5]] * 100
    assert not any(each.manifest.used_after_its_end for each in ended)
    assert stays.numbers == list(range(1, 501))


def test_a_group_that_takes_the_place_of_another_is_told_behind_it(queue):
    before = _Told(queue)
    before.feed_sets(2)
    after = GroupRelay(before.group.config, now=lambda: 0)
    writer = ManifestWriter(after.config, node="/syncrelay", topics=[("/a", "/x"), ("/b", "/y")], bundle=None)
    after.tell_sets(queue.begin("front", writer, before.manifest))
    for index in range(2):
        after.connect(index, Outlet(), restamped=False)
        after.flow.receive(index, Named(b"", BEGIN), BEGIN)
    queue.keep(())
    assert before.numbers == [1, 2, 1]


def test_what_an_output_gave_is_told_before_it_numbers_anew(queue):
    told = _Told(queue)
    told.feed_sets(2)
    told.group.connect(0, Outlet(), restamped=False)
    assert told.numbers == [1, 2]


def test_they_are_published_from_when_somebody_subscribes(queue):
    told = _Told(queue)
    told.manifest.heard = False
    queue.look()
    with _running(queue):
        told.manifest.heard = True
        queue.look()
        told.feed_sets()
        wait_until(lambda: told.manifest.sent == 1, "the first manifest")


def test_the_last_are_published_at_the_end(queue):
    told = _Told(queue)
    told.feed_sets(3)
    queue.stop()
    queue.run()
    assert told.numbers == [1, 2, 3]


def test_what_is_left_out_while_too_many_wait_is_counted_and_said_once(queue, caplog, monkeypatch):
    monkeypatch.setattr(manifest_queue, "MOST_NOTED", 10)
    told = _Told(queue)
    told.feed_sets(13)
    queue.publish()
    queue.look()
    told.feed_sets(12)
    queue.look()
    queue.keep(())
    assert told.numbers == [*range(1, 11), *range(14, 24)]
    assert told.outlets[0].sent == 25
    said, in_all = [record.message for record in caplog.records]
    assert said == "front: leaving out manifests, because 10 are waiting to be published; sets leave as usual"
    assert in_all == "front: 5 manifests were left out"
