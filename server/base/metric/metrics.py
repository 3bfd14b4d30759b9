"""The figures of one station, as Prometheus reads them.

Names follow its conventions: they begin with ``grace_``, hold base units, and end in ``_total``
where they only grow. Of a label there are few values: a robot, a route's template, a level; never
an id that somebody can make up.
"""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Final, TypeAlias

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector
from sqlalchemy.orm import Session

from db.fault import StoreError
from db.store import Store

log = logging.getLogger(__name__)

Row: TypeAlias = tuple[Sequence[str], float]
"""The values of a figure's labels, and the figure."""
Read: TypeAlias = Callable[[], Iterable[Metric]]
Query: TypeAlias = Callable[[Session], Iterable[Metric]]
MEDIA_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"
_PREFIX: Final = "grace_"


class Metrics:
    """Where each capability registers what it can say in figures, when it is installed.

    It has a registry of its own, so that two stations may run in one process. Figures that are
    asked for at each scrape come from functions (``add``, ``add_query``); what happens in between
    is counted by ``counter`` and ``histogram``, from any thread.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry(auto_describe=False)
        self._queries: list[Query] = []
        self._queried: list[Metric] = []
        self._failures = self.counter(
            "metrics_failures", "Parts of a scrape that could not be told.", ("part",)
        )
        self.add(lambda: self._queried)

    def counter(self, name: str, text: str, labels: Sequence[str] = ()) -> Counter:
        """Return a counter that the caller adds to; its name gets ``_total``."""
        return Counter(_PREFIX + name, text, labels, registry=self.registry)

    def histogram(
        self, name: str, text: str, buckets: Sequence[float], labels: Sequence[str] = ()
    ) -> Histogram:
        """Return a histogram that the caller tells of what took how long."""
        return Histogram(_PREFIX + name, text, labels, buckets=buckets, registry=self.registry)

    def add(self, read: Read) -> None:
        """Have a function asked at each scrape; it returns at once, by what is in memory."""
        self.registry.register(_Asked(read, self._failed))

    def add_query(self, query: Query) -> None:
        """Have the database asked at each scrape; while it fails, its figures are left out."""
        self._queries.append(query)

    async def text(self, store: Store) -> bytes:
        """Return every figure in the text format of Prometheus. Call it on the event loop."""
        queried: list[Metric] = []
        with suppress(StoreError):
            queried = await store.query(self._ask)
        self._queried = queried  # read below, before another scrape has its turn
        return generate_latest(self.registry)

    def _ask(self, session: Session) -> list[Metric]:
        found: list[Metric] = []
        for query in self._queries:
            found += query(session)
        return found

    def _failed(self, part: str) -> None:
        self._failures.labels(part).inc()


class _Asked(Collector):
    """One function that is asked at each scrape; if it fails the others are told."""

    def __init__(self, read: Read, on_failure: Callable[[str], None]) -> None:
        self._read = read
        self._on_failure = on_failure

    def collect(self) -> Iterable[Metric]:
        try:
            return list(self._read())
        except Exception:
            log.exception("figures are left out of a scrape")
            self._on_failure(self._read.__module__)
            return []


def gauge(name: str, text: str, value: float) -> Metric:
    """Return a figure that goes up and down."""
    return GaugeMetricFamily(_PREFIX + name, text, value=value)


def gauges(name: str, text: str, labels: Sequence[str], rows: Iterable[Row]) -> Metric:
    """Return a figure that goes up and down, for each of some things."""
    return _filled(GaugeMetricFamily(_PREFIX + name, text, labels=labels), rows)


def totals(name: str, text: str, labels: Sequence[str], rows: Iterable[Row]) -> Metric:
    """Return a figure that only grows, for each of some things; its name gets ``_total``."""
    return _filled(CounterMetricFamily(_PREFIX + name, text, labels=labels), rows)


def counted(name: str, text: str, label: str, values: Mapping[str, float]) -> Metric:
    """Return a figure that goes up and down for each value of one label."""
    return gauges(name, text, (label,), (((key,), value) for key, value in values.items()))


def _filled(
    family: GaugeMetricFamily | CounterMetricFamily, rows: Iterable[Row]
) -> GaugeMetricFamily | CounterMetricFamily:
    for labels, value in rows:
        family.add_metric(labels, value)
    return family
