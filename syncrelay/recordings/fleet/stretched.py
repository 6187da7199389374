"""Long recordings done in stretches, several at a time, with the sets of one pass: an engine in front of an engine.

A stretch is written by going on from where the one before ended. That is known when the one before is written, or when
it has been scouted: replayed with nothing decoded and nothing written, which takes much less. A scout that did not
begin in the state in which the stretch before ended is thrown away, and has cost nothing but time. See
docs/explanation/stretches.md.
"""

import shutil
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Protocol

from syncrelay.recordings.bag.stretches import Stretch, StretchResult, total
from syncrelay.recordings.fleet.content import Content, sync_folder
from syncrelay.recordings.fleet.engine import Engine, Finished
from syncrelay.recordings.fleet.task import JSON, Source, Task
from syncrelay.recordings.fleet.work import Done, Failed, Job, Midway, Outcome, finished, whole


@dataclass(frozen=True, slots=True)
class Place:
    """A stretch, its number from 1, how the one before ended, and how many sets each group gave before it."""

    number: int
    stretch: Stretch
    after: StretchResult | None
    sets: tuple[int, ...]


class LongTask(Task, Protocol):
    """A task that can also be done stretch by stretch; its `run` gives what a recording of one stretch gives."""

    def cut(self, source: Source) -> tuple[Sequence[Stretch], dict[str, JSON]]:
        """Return the stretches of a recording, and the facts that are known before any is read."""
        ...

    def scout(self, source: Source, stretch: Stretch) -> StretchResult:
        """Replay a stretch and write nothing."""
        ...

    def write(self, source: Source, place: Place, folder: Path) -> StretchResult:
        """Write the results of a stretch into a folder, under names that no other stretch of the recording gives.

        Raises SyncRelayError where stretches do not give what one pass would; the recording is then done by `run`.
        """
        ...

    def facts(self, results: Sequence[StretchResult]) -> dict[str, JSON]:
        """Return the facts that are known when all stretches are done."""
        ...


class InStretches:
    """Has an engine do recordings stretch by stretch; an Engine itself."""

    def __init__(self, engine: Engine, task: LongTask) -> None:
        """Do jobs that are all of this task."""
        self._engine = engine
        self._task = task

    def run(self, jobs: Iterable[Job | None]) -> Generator[Finished | None, None, None]:
        """See Engine."""
        plan = _Plan(self._task, jobs)
        with closing(self._engine.run(plan.jobs())) as ended:
            for each in ended:
                yield None if each is None else plan.take(each)


@dataclass(frozen=True, slots=True)
class _Cut:
    """What a first look at a recording of several stretches has found."""

    content: Content
    stretches: Sequence[Stretch]
    facts: Mapping[str, JSON]


@dataclass(frozen=True, slots=True)
class _Look:
    """Cuts a recording; one of a single stretch is done at once."""

    task: LongTask

    def __call__(self, job: Job, content: Content, folder: Path) -> Outcome:
        stretches, facts = self.task.cut(job.source)
        return whole(job, content, folder) if len(stretches) == 1 else Midway(_Cut(content, stretches, facts))


@dataclass(frozen=True, slots=True)
class _Scout:
    task: LongTask
    number: int
    stretch: Stretch

    def __call__(self, job: Job, _content: Content, _folder: Path) -> Outcome:
        return Midway(self.task.scout(job.source, self.stretch))


@dataclass(frozen=True, slots=True)
class _Written:
    result: StretchResult
    done: Done


@dataclass(frozen=True, slots=True)
class _Write:
    task: LongTask
    place: Place

    def __call__(self, job: Job, content: Content, folder: Path) -> Outcome:
        folder.mkdir(parents=True)
        result = self.task.write(job.source, self.place, folder)
        return Midway(_Written(result, finished(job, content, {}, folder)))


@dataclass(slots=True)
class _Course:
    """How far one recording is."""

    job: Job
    task: LongTask
    found: _Cut
    _settled: list[StretchResult] = field(default_factory=list)
    """What the first stretches give in one pass."""
    _scouts: dict[int, StretchResult] = field(default_factory=dict)
    _written: dict[int, Done] = field(default_factory=dict)
    _begun: set[str] = field(default_factory=set)

    def to_write(self) -> Job | None:
        """Return what writes the next stretch, None if all are begun or it is not known yet how the one before ends."""
        known = self.found.stretches[: len(self._settled) + 1]
        for number, stretch in enumerate(known, 1):
            if self._begin(part := f"write-{number}."):
                before = self._settled[: number - 1]
                place = Place(number, stretch, before[-1] if before else None, _sets(before))
                if before:
                    self._settled[number - 2] = before[-1].without_engines()
                return self._part(part, _Write(self.task, place))
        return None

    def to_scout(self) -> Job | None:
        """Return what scouts the next stretch of which it is not known how it ends; none follows the last one."""
        first = len(self._settled)
        for number, stretch in enumerate(self.found.stretches[first:-1], first + 1):
            if self._begin(part := f"scout-{number}."):
                return self._part(part, _Scout(self.task, number, stretch))
        return None

    def scouted(self, number: int, result: StretchResult) -> None:
        """Take how a stretch ends, if it began as the one before ends."""
        self._scouts[number] = result
        self._settle()

    def wrote(self, number: int, written: _Written) -> None:
        """Take a stretch that is written."""
        self._written[number] = written.done
        if number == len(self._settled) + 1:
            self._settled.append(written.result)
        self._settle()

    @property
    def is_done(self) -> bool:
        """Whether all stretches are written."""
        return len(self._written) == len(self.found.stretches)

    def joined(self) -> Done:
        """Put the files of all stretches into one folder: the result of the recording."""
        folder = self.job.scratch_folder()
        folder.mkdir()
        files = {}
        for number in range(1, len(self._written) + 1):
            done = self._written[number]
            for name, file in done.files.items():
                (done.folder / name).rename(folder / name)
                files[name] = file
            done.folder.rmdir()
        sync_folder(folder)
        return Done(self.found.content, {**self.found.facts, **self.task.facts(self._settled)}, files, folder)

    def give_up(self) -> None:
        """Remove what was written."""
        for done in self._written.values():
            shutil.rmtree(done.folder, ignore_errors=True)

    def _begin(self, part: str) -> bool:
        """Tell whether a part is yet to be begun, as it now is."""
        is_new = part not in self._begun
        self._begun.add(part)
        return is_new

    def _part(self, part: str, work: _Write | _Scout) -> Job:
        return replace(self.job, work=work, part=part, content=self.found.content)

    def _settle(self) -> None:
        while (scout := self._scouts.pop(len(self._settled) + 1, None)) is not None:
            if self._settled and not scout.follows(self._settled[-1]):
                return
            self._settled.append(scout)


class _Plan:
    """What is to be done next.

    Recordings are begun before others are scouted: a scout is work that a recording done by one worker is spared.
    """

    def __init__(self, task: LongTask, jobs: Iterable[Job | None]) -> None:
        self._task = task
        self._waiting = iter(jobs)
        self._asked: dict[str, Job] = {}
        self._courses: dict[str, _Course] = {}
        self._uncut: list[Job] = []

    def jobs(self) -> Iterator[Job | None]:
        """Yield for ever what there is to do, or None."""
        while True:
            yield self._next()

    def take(self, ended: Finished) -> Finished | None:
        """Take a job that has ended, and return the one that was asked for if that is done by it."""
        work, outcome, name = ended.job.work, ended.outcome, ended.job.source.name
        course = self._courses.get(name)
        if isinstance(outcome, Midway) and isinstance(outcome.told, _Cut):
            self._courses[name] = _Course(self._asked[name], self._task, outcome.told)
            return None
        if isinstance(work, _Scout):
            if course is not None and isinstance(outcome, Midway):
                course.scouted(work.number, outcome.told)
            return None
        if isinstance(work, _Write):
            return None if course is None else self._wrote(course, work.place.number, outcome)
        return Finished(self._asked.pop(name), outcome)

    def _next(self) -> Job | None:
        for course in self._courses.values():
            if (job := course.to_write()) is not None:
                return job
        if self._uncut:
            return self._uncut.pop()
        if (job := next(self._waiting, None)) is not None:
            self._asked[job.source.name] = job
            return replace(job, work=_Look(self._task))
        return next((job for course in self._courses.values() if (job := course.to_scout()) is not None), None)

    def _wrote(self, course: _Course, number: int, outcome: Outcome) -> Finished | None:
        name = course.job.source.name
        if isinstance(outcome, Midway):
            course.wrote(number, outcome.told)
            if not course.is_done:
                return None
            outcome = course.joined()
        else:
            course.give_up()
        del self._courses[name]
        if isinstance(outcome, Failed) and not outcome.is_bug and not outcome.ends_all:
            # What does not come in parts may still be done as a whole; if not, that says why.
            self._uncut.append(replace(course.job, content=course.found.content))
            return None
        return Finished(self._asked.pop(name), outcome)


def _sets(results: Sequence[StretchResult]) -> tuple[int, ...]:
    return tuple(each.sets for each in total(results))
