"""The field maps that detections are held against: those that were kept, and the present ones."""

from bisect import bisect_left
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime

from sqlalchemy.orm import Session

from autonomy.channel import ChannelCatalogue
from db.query.measured.maps import get_maps, map_times
from server.map.record import view_of
from webui.scene.source import MapView


@dataclass(frozen=True, slots=True)
class MappedVariable:
    """The maps of one variable that some times are nearest to, in order of time."""

    title: str
    unit: str
    times: Sequence[datetime]
    maps: Sequence[MapView]

    def nearest(self, at: datetime) -> int:
        """Return which map is nearest in time."""
        return nearest(self.times, at)


def nearest(times: Sequence[datetime], at: datetime) -> int:
    """Return which of some ascending times is nearest."""
    behind = bisect_left(times, at)
    if behind == 0 or behind == len(times):
        return max(0, behind - 1)
    return behind - 1 if at - times[behind - 1] <= times[behind] - at else behind


def mapped_variables(
    session: Session,
    robot: str,
    wanted: Iterable[datetime],
    present: Iterable[MapView],
    catalogue: ChannelCatalogue,
) -> list[MappedVariable]:
    """Return for every mapped variable the maps that the wanted times are nearest to.

    Args:
        session: A reading session.
        robot: Whose maps.
        wanted: Times of detections.
        present: Maps as they are now; of a variable the first counts, whose model is in use.
        catalogue: The channels that can be mapped.

    Raises:
        UnknownIdError: If there is no such robot.
    """
    in_use: dict[str, MapView] = {}
    for view in present:
        if view.updated_at is not None:
            in_use.setdefault(view.variable.key, view)
    known: dict[str, list[tuple[datetime, int | None]]] = {
        key: [(view.updated_at, None)]
        for key, view in in_use.items()
        if view.updated_at is not None
    }
    for key, variable, model, at in map_times(session, robot):
        if variable not in in_use or in_use[variable].model == model:
            known.setdefault(variable, []).append((at, key))
    asked = list(wanted)
    found: list[MappedVariable] = []
    for variable, candidates in sorted(known.items()):
        channel = catalogue.get(variable)
        if channel is None:
            continue
        candidates.sort(key=lambda one: one[0])
        times = [at for at, _ in candidates]
        chosen = sorted({nearest(times, at) for at in asked})
        keys = [key for index in chosen if (key := candidates[index][1]) is not None]
        kept = get_maps(session, robot, keys)
        maps = [
            in_use[variable] if key is None else view_of(kept[key], channel)
            for index in chosen
            for key in (candidates[index][1],)
        ]
        found.append(
            MappedVariable(channel.title, channel.unit, [times[index] for index in chosen], maps)
        )
    return found
