"""What was taken in of robots, in figures."""

from robot_link.clock import Clock
from server.base.metric.metrics import Metrics, gauges
from server.link.event import SamplesStored


class IntakeFigures:
    """Counts samples once they are stored, and how long robots wait for that word.

    A robot keeps a sample until it is acknowledged, which follows the commit at once.
    """

    def __init__(self, metrics: Metrics, clock: Clock) -> None:
        self._clock = clock
        self._samples = metrics.counter(
            "robot_samples", "Samples of a robot that were stored.", ("robot",)
        )
        self._refused = metrics.counter(
            "robot_samples_refused", "Samples of a robot that could not be true.", ("robot",)
        )
        self._lag_s: dict[str, float] = {}
        metrics.add(
            lambda: [
                gauges(
                    "robot_acknowledgement_lag_seconds",
                    "From the arrival of the newest samples to their acknowledgement.",
                    ("robot",),
                    (((robot,), lag_s) for robot, lag_s in self._lag_s.items()),
                )
            ]
        )

    def stored(self, event: SamplesStored) -> None:
        """Take that samples are stored, and acknowledged."""
        now = self._clock.now()
        for sample in event.samples:
            self._samples.labels(sample.robot).inc()
            # A demo's clock runs faster than the wall, which this is about.
            waited_s = (now - sample.received_at).total_seconds()
            self._lag_s[sample.robot] = waited_s / self._clock.speed
        for sample in event.refused:
            self._refused.labels(sample.robot).inc()
