"""A recording and a file: figures of topics and pairs, what each group gives, and what it could give."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations

from syncrelay.config import GroupConfig, load_text
from syncrelay.config.load import spelt_out
from syncrelay.explain.nearest import LONGEST
from syncrelay.explain.possible_sets import PossibleSets
from syncrelay.explain.trials import Trials
from syncrelay.recordings.analysis.changes import Change, with_changes
from syncrelay.recordings.analysis.curves import Curves, curves_of
from syncrelay.recordings.analysis.evaluation import Evaluation, evaluate
from syncrelay.recordings.analysis.mappings import MappedInput, MappingCurve, mapped_inputs
from syncrelay.recordings.analysis.pairs import Pair, pair
from syncrelay.recordings.analysis.streams import Stream, read_streams, stamped
from syncrelay.recordings.analysis.suggest import Suggestion, suggest, trials_of
from syncrelay.recordings.analysis.topics import TopicFigures, figures_of
from syncrelay.recordings.analysis.unneeded import InputFates, Unneeded, find_unneeded, input_fates
from syncrelay.recordings.analysis.watching import LastingFinding, watch_group
from syncrelay.recordings.bag.bindings import GroupBinding
from syncrelay.recordings.bag.recording import Recording
from syncrelay.recordings.forks import side_by_side


# No slots: what takes long is found when it is first asked for, and kept.
@dataclass(frozen=True)
class GroupAnalysis:
    """One group, and the group with the suggested values.

    `trials` are those of the group's engine on the whole recording: from them come all values that are suggested.
    """

    group: GroupConfig
    suggested: GroupConfig
    streams: tuple[Stream, ...]
    pairs: tuple[Pair, ...]
    trials: Trials
    evaluation: Evaluation
    suggestion: Suggestion

    @cached_property
    def findings(self) -> tuple[LastingFinding, ...]:
        """What the running relay would have found, the worst first: it judges once a second of the recording."""
        return watch_group(self.group, self.streams, self.evaluation, whole=lambda: self.trials)

    @property
    def possible(self) -> PossibleSets | None:
        """The sets of one moment.

        None where no measure tells which messages belong together, or a required input has no stamps.
        """
        return None if self.group.options.matched_by else self.trials.possible()

    @cached_property
    def mapped(self) -> tuple[tuple[MappedInput, MappingCurve], ...]:
        """The inputs whose stamps were mapped to the host's time, and how."""
        return tuple(mapped_inputs(self.group, self.streams))

    @cached_property
    def unneeded(self) -> Unneeded:
        """Which dropped messages cost no set."""
        if self.possible is None or not len(self.possible):
            return find_unneeded(self.group, self.evaluation, None)
        slop = self.group.options.tolerance.ns if self.group.options.tolerance else LONGEST
        return find_unneeded(self.group, self.evaluation, slop if self.possible.is_alone else self.possible.widest)

    @property
    def fates(self) -> tuple[InputFates, ...]:
        """Where the messages of each input went."""
        return input_fates(self.group, self.evaluation, self.unneeded)

    @cached_property
    def curves(self) -> Curves | None:
        """What other values would give; None where possible sets are not known."""
        return curves_of(self.group, self.suggested, self.streams)


@dataclass(frozen=True, slots=True)
class Analysis:
    """A recording; `text` is the file that its groups are from, `faults` what of it is missing or cannot be read."""

    begin: int
    end: int
    topics: tuple[TopicFigures, ...]
    groups: tuple[GroupAnalysis, ...]
    text: str
    faults: tuple[str, ...]

    @property
    def changes(self) -> tuple[Change, ...]:
        """All that is suggested."""
        return tuple(change for each in self.groups for change in each.suggestion.changes)


def analyze(recording: Recording, text: str, bindings: Sequence[GroupBinding]) -> Analysis:
    """Read a recording to its end and return what it tells, and what the groups of a file's text make of it.

    Raises BagError for a stamp or key that a recorded type does not have.
    """
    streams = read_streams(recording, bindings)
    groups = tuple(
        analyze_group(binding.group, of_group, text) for binding, of_group in zip(bindings, streams, strict=True)
    )
    distinct = {(stream.topic, id(stream)): stream for of_group in streams for stream in of_group}
    topics = tuple(figures_of(stream) for stream in distinct.values() if len(stream.stamps))
    return Analysis(recording.begin, recording.end, topics, groups, text, tuple(recording.faults))


def find_all(analysis: Analysis) -> None:
    """Find what takes long of each group, on all cores."""
    wanted = [(group, name) for group in analysis.groups for name in ("findings", "curves")]
    for (group, name), found in zip(wanted, side_by_side([partial(getattr, *each) for each in wanted]), strict=True):
        # There it is kept when it is first asked for.
        vars(group)[name] = found


def with_suggestions(analysis: Analysis) -> Analysis:
    """Return the analysis of the file with all that was suggested."""
    text = with_changes(analysis.text, analysis.changes)
    groups = []
    for each in analysis.groups:
        group = group_of(text, each.group.name)
        groups.append(analyze_group(group, tuple(stamped(group, each.streams)), text))
    return replace(analysis, groups=tuple(groups), text=text)


def group_of(text: str, name: str) -> GroupConfig:
    """Return a group of a file's text."""
    groups = load_text(text).groups
    return next(group for group in groups if group.name == name)


def analyze_group(group: GroupConfig, streams: tuple[Stream, ...], text: str) -> GroupAnalysis:
    """Return what a group of a file's text makes of the streams of its inputs."""
    evaluation = evaluate(group, streams)
    offsets = [topic.offset_ns for topic in group.topics]
    pairs = [
        pair(streams[first], streams[second], (offsets[first], offsets[second]))
        for first, second in combinations(range(len(streams)), 2)
    ]

    # Where groups share values, those of this one alone are tried.
    apart = spelt_out(text)

    def changed(changes: Sequence[Change]) -> GroupConfig:
        return group_of(with_changes(apart, changes), group.name) if changes else group

    trials = trials_of(group, streams, evaluation)
    suggestion = suggest(group, streams, trials, evaluation, changed)
    return GroupAnalysis(
        group=group,
        suggested=changed(suggestion.changes),
        streams=streams,
        pairs=tuple(each for each in pairs if each is not None),
        trials=trials,
        evaluation=evaluation,
        suggestion=suggestion,
    )
