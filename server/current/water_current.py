"""What is known of the current of one water."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from autonomy.current.config import CurrentMapConfig
from autonomy.current.model import FEWEST, Appended, CurrentMap, Observation, Taking
from server.current.record import (
    Forecast,
    KeptObservation,
    Verdict,
    forecast_after,
    verdict_on,
)
from server.current.told import KeptTold
from server.fleet.water import Water

JUDGED = 10
"""Newest predictions by which the map is judged."""


@dataclass(frozen=True, slots=True)
class Taken:
    """What became of observations that were new."""

    kept: tuple[KeptObservation, ...]
    told: tuple[tuple[str, Appended], ...]
    """Which robot's were doubted or refused, and why."""


@dataclass(slots=True, eq=False)
class WaterCurrent:
    """The map of one water's current with what its predictions were worth; never changed in place.

    ``with_observations`` and ``relearned`` return another one, so whoever reads sees one state.
    """

    water: Water
    robots: tuple[str, ...]
    config: CurrentMapConfig
    known: CurrentMap
    new: int = 0
    """Observations since its settings were last learned."""
    forecasts: dict[str, Forecast] = field(default_factory=dict[str, Forecast])
    """Newest of each robot."""
    verdicts: deque[Verdict] = field(default_factory=lambda: deque[Verdict](maxlen=JUDGED))
    told: KeptTold | None = None
    """What somebody tells of it besides; ``known`` has its field."""
    left_out: dict[str, str] = field(default_factory=dict[str, str])
    """Why a robot's newest dive was not counted."""

    @classmethod
    def of(
        cls,
        water: Water,
        robots: tuple[str, ...],
        config: CurrentMapConfig,
        kept: Sequence[KeptObservation],
        learned: CurrentMapConfig | None,
        learned_until_s: float,
    ) -> "WaterCurrent":
        """Return what the stored observations of a water make."""
        latitude = water.latitude_deg
        known = CurrentMap.of([one.observation for one in kept], config, latitude, learned)
        made = cls(water, robots, config, known)
        for one in kept:
            made.new += float(one.observation.time_s[-1]) > learned_until_s
            if one.verdict is not None:
                made.verdicts.append(one.verdict)
            if one.forecast is not None:
                made.forecasts[one.observation.robot] = one.forecast
        return made

    @property
    def dives(self) -> tuple[Observation, ...]:
        """Dives that the map is made of."""
        return tuple(one for one in self.known.observations if not one.is_surface)

    @property
    def has_enough(self) -> bool:
        """Whether the map is wanted, and of dives enough to tell anything."""
        return self.config.enabled and len(self.dives) >= FEWEST

    @property
    def is_learning_due(self) -> bool:
        """Whether there is enough that was not learned from."""
        config = self.config
        first = self.known.learned is None
        return (
            config.enabled
            and config.learn
            and self.new >= (config.learn_first if first else config.learn_every)
        )

    def tells(self, time_s: float) -> bool:
        """Tell whether dives enough, or somebody, tell of the current at a moment."""
        return self.has_enough or (self.config.enabled and self.known.is_told(time_s))

    def is_usable(self, now_s: float) -> bool:
        """Tell whether a plan may rely on the map now: by recent dives, or by what is told."""
        is_told = self.config.enabled and self.known.is_told(now_s)
        return is_told or self.is_carrier(now_s)

    def is_carrier(self, now_s: float) -> bool:
        """Tell whether dives enough, and recent ones, tell how the water moved until now."""
        age_s = now_s - self.known.newest_s
        return self.has_enough and age_s <= self.config.basin_memory_s

    def with_observations(
        self, observations: Sequence[Observation]
    ) -> tuple["WaterCurrent", Taken]:
        """Return the same with more observations, and what became of each of them."""
        made = replace(
            self,
            known=self.known.copy(),
            forecasts=dict(self.forecasts),
            verdicts=deque(self.verdicts, maxlen=JUDGED),
        )
        kept: list[KeptObservation] = []
        told: list[tuple[str, Appended]] = []
        for one in observations:
            appended = made.known.append(one)
            if appended.text:
                told.append((one.robot, appended))
            if appended.taking in {Taking.REFUSED, Taking.REPEATED}:
                continue
            made.new += 1
            same = (other for other in made.known.observations if other.key == one.key)
            kept.append(_judged(made, next(same, one)))
        return made, Taken(tuple(kept), tuple(told))

    def relearned(self, learned: CurrentMapConfig) -> "WaterCurrent":
        """Return the same with what was learned."""
        known = self.known.copy()
        known.relearned(learned)
        return replace(self, known=known, new=0)


def _judged(made: WaterCurrent, one: Observation) -> KeptObservation:
    """Return an observation with what was said of it before, and what is said after it."""
    if one.is_surface:
        return KeptObservation(one, None, None)
    verdict = verdict_on(made.forecasts.get(one.robot), one)
    if verdict is not None:
        made.verdicts.append(verdict)
    forecast = forecast_after(made.known, one)
    made.forecasts[one.robot] = forecast
    return KeptObservation(one, forecast, verdict)
