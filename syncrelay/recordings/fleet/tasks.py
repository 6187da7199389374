"""What `fleet replay`, `export --format mcap` and `fleet analyze` do with each recording."""

import json
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from syncrelay.collector import eased_collector
from syncrelay.config import Config, load_text
from syncrelay.recordings.analysis import analyze, inventory, with_suggestions
from syncrelay.recordings.analysis.few_sets import why_few_sets
from syncrelay.recordings.analysis.proposal import bind_file_or_topics
from syncrelay.recordings.analysis.report_json import as_json, inventory_as_json
from syncrelay.recordings.bag import Recording, open_recording
from syncrelay.recordings.bag.bindings import GroupBinding, bind
from syncrelay.recordings.bag.mcap_output import Compression, McapOutput
from syncrelay.recordings.bag.replay import GroupResult
from syncrelay.recordings.bag.replay import replay as replay_groups
from syncrelay.recordings.bag.what_if import Disturbed
from syncrelay.recordings.bag.writing import SetWriter
from syncrelay.recordings.fleet.facts import FACTS, rows_of
from syncrelay.recordings.fleet.task import (
    JSON,
    NOTES,
    PROBLEMS,
    Source,
    fingerprint_of,
    short_hash,
    what_decides_outputs,
    what_decides_sets,
)
from syncrelay.rig.what_if import Fault

SETS: Final = "sets.mcap"
"""The file of a recording's sets in the folder of its result, as `replay -o` writes it."""
ANALYSIS: Final = "analysis.json"
"""The file of a recording's analysis in the folder of its result, as `analyze --json` prints it."""


@dataclass(frozen=True, slots=True)
class ReplayTask:
    """Writes the sets of a recording; see Task. Facts are the counts of each input."""

    config: Config
    what_if: tuple[Fault, ...]
    seed: int
    compression: Compression
    fingerprint: str

    @classmethod
    def of(cls, config: Config, what_if: tuple[Fault, ...], seed: int, compression: Compression) -> Self:
        """Return the task of a file. Faults that are random are drawn with `seed`."""
        options: dict[str, JSON] = {"what_if": [fault.written for fault in what_if], "seed": seed if what_if else 0}
        options["compression"] = compression
        fingerprint = fingerprint_of("replay", config=what_decides_outputs(config.groups), options=options)
        return cls(config, what_if, seed, compression, fingerprint)

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with closing(open_recording([source.place])) as plain, eased_collector():
            recording = Disturbed(plain, self.what_if, seed=self.seed) if self.what_if else plain
            bindings = bind(self.config, recording)
            with McapOutput(folder / SETS, compression=self.compression) as output:
                writer = SetWriter(output)
                for binding in bindings:
                    writer.begin(binding)
                results = replay_groups(recording, bindings, listeners=[writer.take])
            return {
                **about(recording, bindings),
                **few_sets(recording, bindings, () if self.what_if else results, more=writer.left_out),
                "messages": writer.messages,
                "groups": [counts_of(result) for result in results],
            }


@dataclass(frozen=True, slots=True)
class AnalyzeTask:
    """Writes the analysis of a recording, and its rows of the table of facts; see Task."""

    file: str | None
    text: str | None
    topics: tuple[str, ...]
    file_hash: str | None
    fingerprint: str

    @classmethod
    def of(cls, *, file: str | None, text: str | None, topics: tuple[str, ...]) -> Self:
        """Return the task for the groups of a file's text, for topics as one group, or for neither: an inventory."""
        groups = () if text is None else load_text(text, name=file or "<text>").groups
        config = what_decides_sets(groups) if groups else ""
        fingerprint = fingerprint_of("analyze", config=config, options={"topics": list(topics)})
        return cls(file, text, topics, short_hash(config) if config else None, fingerprint)

    def run(self, source: Source, folder: Path) -> dict[str, JSON]:
        """See Task."""
        with closing(open_recording([source.place])) as recording, eased_collector():
            if self.text is None and not self.topics:
                document = inventory_as_json(source.shown, recording, inventory(recording))
                facts = about(recording, ())
            else:
                text, bindings = bind_file_or_topics(recording, file=self.file, text=self.text, topics=self.topics)
                analysis = analyze(recording, text, bindings)
                if self.text is None:
                    analysis = with_suggestions(analysis)
                document = as_json(source.shown, analysis)
                facts = about(recording, bindings)
                problems = problems_of(recording, bindings)
                rows = rows_of(analysis, recording=source.shown, problems=problems, file_hash=self.file_hash)
                (folder / FACTS).write_text("".join(f"{row.model_dump_json()}\n" for row in rows), encoding="utf-8")
        (folder / ANALYSIS).write_text(f"{json.dumps(document, indent=2)}\n")
        return facts


def about(recording: Recording, bindings: Sequence[GroupBinding], *, more: Sequence[str] = ()) -> dict[str, JSON]:
    """Return the facts of any recording: when it begins and ends, and its problems, with `more` of them."""
    problems: list[JSON] = [*problems_of(recording, bindings), *more]
    facts: dict[str, JSON] = {"begin": recording.begin, "end": recording.end}
    return {**facts, PROBLEMS: problems} if problems else facts


def problems_of(recording: Recording, bindings: Sequence[GroupBinding]) -> list[str]:
    """Return what a recording lacks, and what of it is damaged, a sentence each."""
    lacking = (problem for binding in bindings if not binding.is_complete for problem in binding.problems)
    return [*lacking, *recording.faults]


def few_sets(
    recording: Recording,
    bindings: Sequence[GroupBinding],
    results: Sequence[GroupResult],
    *,
    more: Sequence[str] = (),
) -> dict[str, JSON]:
    """Return a note for each complete group that gave few of its possible sets: what costs the others; and `more`."""
    found = [
        why_few_sets(recording, binding, [each.counts for each in result.inputs], result.sets)
        for binding, result in zip(bindings, results, strict=bool(results))
        if binding.is_complete
    ]
    notes: list[JSON] = [*more, *(sentence for sentence in found if sentence is not None)]
    return {NOTES: notes} if notes else {}


def counts_of(result: GroupResult) -> dict[str, JSON]:
    """Return the sets of a group and what became of its messages, under the keys that an analysis has."""
    inputs: list[JSON] = [
        {
            "topic": each.topic,
            "received": each.counts.fed,
            "matched": each.counts.matched,
            "dropped": {reason.value: count for reason, count in each.counts.dropped.items()},
        }
        for each in result.inputs
    ]
    return {"name": result.name, "sets": result.sets, "inputs": inputs}
