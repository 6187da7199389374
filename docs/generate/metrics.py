"""The metrics as their page shows them: those of a relay that ran for a while, on simulated sensors."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from syncrelay.config.names_in_graph import SCALARS
from syncrelay.status.metrics import families
from tests.top.states import healthy


@dataclass(frozen=True, slots=True)
class _Metric:
    name: str
    kind: str
    labels: Sequence[str]
    meaning: str


def metrics() -> Iterator[_Metric]:
    """Yield every metric, in the order of /metrics."""
    for family in families(healthy()):
        (_, written, _), *_ = family.samples
        # Of a histogram, the bound of a bucket is none of its own.
        labels = tuple(name for name in re.findall(r'(\w+)="', written) if name != "le")
        yield _Metric(family.full_name, family.kind, labels, family.about)


def scalars() -> Sequence[str]:
    """Return the figures that `diagnostics: {scalars: true}` publishes."""
    return SCALARS
