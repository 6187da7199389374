"""Stretches of a recording replayed each by itself, as other processes would, and joined; beside it, one pass."""

import pickle
from collections import defaultdict
from contextlib import closing
from dataclasses import replace
from itertools import pairwise
from typing import Any

from syncrelay.config import load_text
from syncrelay.recordings.bag.bindings import bind
from syncrelay.recordings.bag.replay import replay
from syncrelay.recordings.bag.stretch_replay import run_stretch
from syncrelay.recordings.bag.stretches import settled, total
from syncrelay.sync import Match


class Log:
    """What left each group: of which messages as they were recorded, why or with what stamp, and when."""

    def __init__(self):
        self.left = defaultdict(list)

    def take(self, binding, outcome, now):
        is_set = isinstance(outcome, Match)
        messages = outcome.messages if is_set else (outcome.message,)
        named = [each and (each.payload[0].topic, *each.payload[1:], each.stamp, each.key) for each in messages]
        self.left[binding.group.name].append((named, outcome.stamp if is_set else outcome.reason, now))


def counted(results):
    """All that is counted, but for the length that a queue should have had."""
    return [
        (result.name, result.sets, [(each.topic, replace(each.counts, needed_queue=None)) for each in result.inputs])
        for result in results
    ]


def one_pass(opened, text):
    """What leaves, and the counts."""
    log = Log()
    with closing(opened()) as recording:
        results = replay(recording, bind(load_text(text), recording), listeners=[log.take])
    return log.left, counted(results)


class Stretches:
    """Each replayed on a recording opened for it; its result is pickled, and `redone` are those replayed again."""

    def __init__(self, opened, text):
        self._opened, self._text = opened, text
        self._logs = {}
        self.redone = []

    def run(self, stretch, after=None):
        log = Log()
        with closing(self._opened()) as recording:
            bindings = bind(load_text(self._text), recording)
            result = run_stretch(recording, bindings, stretch, listeners=[log.take], after=after)
        self._logs[stretch] = log.left
        return pickle.loads(pickle.dumps(result))  # noqa: S301  made here

    def _again(self, stretch, before):
        self.redone.append(stretch)
        return self.run(stretch, before)

    def joined(self, stretches):
        """What leaves, and the counts."""
        results = list(settled([self.run(stretch) for stretch in stretches], self._again))
        assert all(after.follows(before) for before, after in pairwise(results))
        return self.left(stretches), counted(total(results))

    def left(self, stretches):
        """What left the groups when stretches were last replayed, one behind another."""
        whole: dict[str, list[Any]] = defaultdict(list)
        for stretch in stretches:
            for name, left in self._logs[stretch].items():
                whole[name] += left
        return whole
