"""The metrics as their page shows them: those of a relay that ran for a while, on simulated sensors."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from prometheus_client.metrics_core import Metric

from syncrelay.config.names_in_graph import SCALARS
from syncrelay.status.metrics import registry
from tests.top.states import healthy

# Of a histogram, the bound of a bucket.
_BOUND = "le"
_ENDINGS = {"counter": "_total", "info": "_info"}


@dataclass(frozen=True, slots=True)
class _Metric:
    name: str
    kind: str
    labels: Sequence[str]
    meaning: str


def metrics() -> Iterator[_Metric]:
    """Yield every metric, in the order of /metrics."""
    for family in registry(healthy).collect():
        yield _metric(family)


def _metric(family: Metric) -> _Metric:
    labels = tuple(label for label in family.samples[0].labels if label != _BOUND)
    return _Metric(family.name + _ENDINGS.get(family.type, ""), family.type, labels, family.documentation)


def scalars() -> Sequence[str]:
    """Return the figures that `diagnostics: {scalars: true}` publishes."""
    return SCALARS
