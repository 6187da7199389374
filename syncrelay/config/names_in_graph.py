"""The names of a file under remaps: what is wrong with them is said in the file's own sentences, at its own places."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

from syncrelay.config.checks import check_names
from syncrelay.config.document import Document
from syncrelay.config.drafts import remapped_drafts
from syncrelay.config.problems import Problem


@dataclass(frozen=True, slots=True, eq=False)
class NamesInFile:
    """The names of a file and where they stand, to be asked what is wrong with what remaps make of them."""

    document: Document

    @property
    def written(self) -> tuple[str, ...]:
        """The names that `problems` has resolved, each once."""
        asked: dict[str, str] = {}
        remapped_drafts(self.document, lambda name: asked.setdefault(name, name))
        return tuple(asked)

    def problems(self, resolve: Callable[[str], str], *, groups: Collection[str]) -> tuple[Problem, ...]:
        """Return what is wrong between the names that `resolve` gives, of the groups with these names, in order.

        `resolve` makes of a name that the file has, relative or not, the one in the graph.
        """
        drafts = [group for group in remapped_drafts(self.document, resolve) if group.name in groups]
        return tuple(sorted(check_names(drafts, self.document), key=lambda problem: problem.span or (0, 0, 0)))
