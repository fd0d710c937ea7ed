"""Readings in the text format of Prometheus, and beside them what a process costs: memory, processor time, open files."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import accumulate
from typing import TYPE_CHECKING

from arena.extras import needs
from arena.metrics.definitions import Histogram, Metric, Reading

if TYPE_CHECKING:
    from prometheus_client import Metric as Family

CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"


def check(what: str = "--metrics") -> None:
    """Refuse metrics, before there is anything to tell, where the library that writes them is missing; `what` needs it."""
    with needs("web", what):
        import prometheus_client  # noqa: F401  # whether it is there is the question


def expose(readings: Iterable[Reading]) -> bytes:
    """Return readings, and those of this process, as Prometheus scrapes them."""
    from prometheus_client import CollectorRegistry, PlatformCollector, ProcessCollector, generate_latest
    from prometheus_client.registry import Collector

    families = [_family(reading.metric, reading.values) for reading in readings]

    class Readings(Collector):
        def collect(self) -> Iterator["Family"]:
            return iter(families)

    registry = CollectorRegistry(auto_describe=False)
    for collector in (Readings(), ProcessCollector(registry=None), PlatformCollector(registry=None)):
        registry.register(collector)
    return generate_latest(registry)


def _family(metric: Metric, values: float | Histogram | Mapping[str, float]) -> "Family":
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily

    if isinstance(values, Histogram):
        names = [*map(str, values.bounds), "+Inf"]
        buckets = [(name, float(n)) for name, n in zip(names, accumulate(values.counts), strict=True)]
        return HistogramMetricFamily(metric.name, metric.help, buckets=buckets, sum_value=values.total)
    make = CounterMetricFamily if metric.kind == "counter" else GaugeMetricFamily
    if not isinstance(values, Mapping):
        return make(metric.name, metric.help, value=values)
    family = make(metric.name, metric.help, labels=[metric.label])
    for label, value in values.items():
        family.add_metric([label], value)
    return family
