"""The names of a file under remaps: what is wrong with them is said in the file's own sentences, at its own places."""

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from itertools import chain

from syncrelay.config.checks import check_names
from syncrelay.config.document import Document
from syncrelay.config.drafts import remapped_drafts
from syncrelay.config.own_topics import check_own_topics
from syncrelay.config.problems import Problem


@dataclass(frozen=True, slots=True, eq=False)
class NamesInFile:
    """The names of a file and where they stand, to be asked what is wrong with what remaps make of them."""

    document: Document

    @property
    def written(self) -> tuple[str, ...]:
        """The names that `problems` has resolved, each once."""
        asked: dict[str, str] = {}
        for _ in self._problems(lambda name: asked.setdefault(name, name), None):
            pass
        return tuple(asked)

    def problems(self, resolve: Callable[[str], str], *, groups: Collection[str]) -> tuple[Problem, ...]:
        """Return what is wrong between the names that `resolve` gives, of the groups with these names, in order.

        `resolve` makes of a name that the file has, relative or not, the one in the graph.
        """
        return tuple(sorted(self._problems(resolve, groups), key=_place))

    def _problems(self, resolve: Callable[[str], str], groups: Collection[str] | None) -> Iterator[Problem]:
        drafts = remapped_drafts(self.document, resolve)
        chosen = [group for group in drafts if groups is None or group.name in groups]
        return chain(check_names(chosen, self.document), check_own_topics(chosen, self.document, resolve))


def _place(problem: Problem) -> tuple[int, int, int]:
    span = problem.span
    return (span.source, span.line, span.column) if span else (0, 0, 0)
