"""The legs of a design: glides between two depths and swims, from wherever the robot is.

In a current the legs say where the robot believes to be; each is aimed off so that it really leads
along the lines that were drawn.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from autonomy.current.table import flow_at, is_uniform, uniform_flow
from autonomy.design.document import (
    Design,
    Manner,
    Mooring,
    Reference,
    StationKeep,
    Waypoint,
)
from autonomy.design.reference import turns_of
from autonomy.design.yo_yo import Line, turning_depths
from autonomy.planner.approach import swim_to
from autonomy.planner.config import PlannerConfig
from autonomy.planner.leg import drift, primitive
from autonomy.planner.leg.edge import AIMS
from autonomy.planner.plan import Leg, PositionNed
from autonomy.site import Site

NorthEast = tuple[float, float]

_SAME_PLACE_M = 0.05
_SEEN_RAD = math.radians(0.5)
"""Other glide angles are remarked on."""
_LOOKS_A_YO = 8
"""Places at which the floor is looked up under one descent and climb."""
_LOOKS_MAX = 2000
_MUCH_LESS = 0.8
"""A deep turn of less than this part of what was asked is remarked."""
LEGS_MAX = 2000
"""Legs of one design."""
_UNLIMITED = 1e9
"""Energy units; a design has no budget but the battery."""
_FAR_M = 1e6
_LONG_S = 604_800.0
_PATIENCE_MAX_S = 86_400.0


@dataclass(frozen=True, slots=True)
class Remark:
    """Something about a waypoint that the one who drew it should know."""

    waypoint: int
    text: str


@dataclass(slots=True)
class LaidOut:
    """Legs of a design."""

    legs: list[Leg] = field(default_factory=list)
    waypoint: list[int] = field(default_factory=list)
    """For each leg, the waypoint that it leads to, counted from 0."""
    remarks: list[Remark] = field(default_factory=list)


def lay_out(
    design: Design,
    waypoints: Sequence[Waypoint],
    config: PlannerConfig,
    site: Site,
    *,
    usual_deep_m: float,
    due_s: Sequence[float] = (),
) -> LaidOut:
    """Turn waypoints into legs from the first waypoint on.

    The way from wherever the robot is to the first waypoint is no leg: the robot swims it by itself
    when it begins (``Stage.APPROACH`` on board), and ``way_there`` tells what it takes.

    Args:
        design: Manner and rules of surfacing.
        waypoints: As ``waypoints_of`` laid them out.
        config: Speeds, prices and the current.
        site: The water, for the floor.
        usual_deep_m: Deep turn of a design that says none.
        due_s: When the robot shall be at the surface, s after the begin.

    Raises:
        ValueError: If a waypoint's manner contradicts itself, or there are more than 2,000 legs;
            the waypoint is named.
    """
    return _Layout(design, waypoints, config, site, usual_deep_m, due_s).run()


class _Layout:
    """One run over the waypoints: where the robot believes to be, and how far it was carried."""

    def __init__(
        self,
        design: Design,
        waypoints: Sequence[Waypoint],
        config: PlannerConfig,
        site: Site,
        usual_deep_m: float,
        due_s: Sequence[float],
    ) -> None:
        self._design, self._waypoints = design, waypoints
        self._config, self._site = config, site
        self._due_s = due_s
        self._survey_deep_m = usual_deep_m
        self._found = LaidOut()
        self._here: PositionNed = (0.0, 0.0, 0.0)
        self._begin = drift.fresh(config, 0.0)
        self._dive_began_s = 0.0

    def run(self) -> LaidOut:
        if not self._waypoints:
            return self._found
        self._here = (*self._waypoints[0].ne_m, 0.0)
        if isinstance(self._design.content, Reference):
            self._follow(self._design.content)
            return self._found
        manners = [_manner(number, one, self._design) for number, one in enumerate(self._waypoints)]
        for number, (waypoint, manner) in enumerate(zip(self._waypoints, manners, strict=True)):
            if number == 0:
                continue
            if math.dist(self._truth()[:2], waypoint.ne_m) < _SAME_PLACE_M:
                raise ValueError(f"waypoints.{number}: it is the same place as the one before")
            if manner.motion == "swim":
                self._swim(number, waypoint.ne_m, manner)
            else:
                self._glide(number, waypoint.ne_m, manner, ends_up=self._surfaces(number, manners))
            if len(self._found.legs) > LEGS_MAX:
                raise ValueError(
                    f"waypoints.{number}: the design has more than {LEGS_MAX:,} legs up to here"
                )
        if isinstance(self._design.content, Mooring):
            self._profiles(self._design.content)
        elif isinstance(self._design.content, StationKeep):
            self._keep(self._design.content, manners[0])
        return self._found

    def _surfaces(self, number: int, manners: Sequence[Manner]) -> bool:
        """Tell whether the robot comes up at a waypoint."""
        if number + 1 == len(manners) or manners[number + 1].motion == "swim":
            return True
        said = self._waypoints[number].surfaces
        return self._design.surfacing.at_waypoints if said is None else said

    def _swim(self, number: int, goal_ne_m: NorthEast, manner: Manner) -> None:
        config = _with_speed(self._config, "swim_speed_m_s", manner.swim_speed_m_s)
        try:
            leg = primitive.swim(config, self._here, (*goal_ne_m, 0.0), self._begin.time_s)
        except ValueError as error:
            raise ValueError(f"waypoints.{number}: {error}") from error
        self._add(number, leg, drift.Course(self._begin, (0.0, 0.0)))

    def _glide(self, number: int, goal_ne_m: NorthEast, manner: Manner, *, ends_up: bool) -> None:
        config = _with_speed(self._config, "glide_speed_m_s", manner.glide_speed_m_s)
        origin = self._truth()
        length_m = math.dist(origin[:2], goal_ne_m)
        angle_rad = _angle_rad(manner, config)
        travel_m = self._travel_m(number, origin, goal_ne_m, manner, config, angle_rad)
        line = Line(
            length_m=length_m,
            travel_m=travel_m,
            steepest_m=self._steepest_m(number, origin, goal_ne_m, manner, config, travel_m),
            begin_m=self._here[2],
            shallow_m=manner.shallow_m,
            ends_up=ends_up,
            depth_change_min_m=config.primitives.depth_change_min_m,
            deep_at=self._floor_rule(manner, origin[:2], goal_ne_m),
            comes_up=self._time_rule(manner, config),
        )
        depths = turning_depths(line)
        if depths is None:
            self._too_short(number, goal_ne_m, manner, length_m)
            return
        self._remark_depth(number, manner, max(depths))
        asked_m, travel_m = travel_m, sum(abs(b - a) for a, b in pairwise(depths))
        self._remark_angle(number, math.tan(angle_rad) * travel_m / asked_m, angle_rad)
        passed_m = 0.0
        for before, depth in pairwise(depths):
            passed_m += abs(depth - before)
            share = passed_m / travel_m
            target = tuple(a + share * (b - a) for a, b in zip(origin[:2], goal_ne_m, strict=True))
            self._add(number, *self._aimed(config, (target[0], target[1], depth)))

    def _travel_m(
        self,
        number: int,
        origin: PositionNed,
        goal_ne_m: NorthEast,
        manner: Manner,
        config: PlannerConfig,
        angle_rad: float,
    ) -> float:
        """Return how much depth a glide takes down and up, the water's way on a line allowed for.

        The robot goes through the water at ``w = v / tan(angle)`` and over ground along the line
        ``d``: ``|d - c T| = w T`` gives the time ``T``, and the travel is ``v T``.
        """
        speed = config.primitives.glide_speed_m_s
        through_m_s = speed / math.tan(angle_rad)
        way = np.array(goal_ne_m) - np.array(origin[:2])
        north_m, east_m = (origin[0] + 0.5 * float(way[0]), origin[1] + 0.5 * float(way[1]))
        deep_m = 0.5 * self._usual_deep_m(manner)
        table = config.current.table
        is_known = is_uniform(table)
        place = (north_m, east_m, deep_m, self._begin.time_s)
        current = np.array(uniform_flow(table) if is_known else flow_at(table, *place))
        a = through_m_s**2 - float(current @ current)
        b = float(way @ current)
        root = b * b + a * float(way @ way)
        if a <= 0.0 or root < 0.0:
            speeds = f"{math.hypot(*current):.2g} m/s; it glides at {through_m_s:.2g} m/s"
            raise ValueError(f"waypoints.{number}: the current is too strong for a glide: {speeds}")
        return speed * (math.sqrt(root) - b) / a

    def _steepest_m(
        self,
        number: int,
        origin: PositionNed,
        goal_ne_m: NorthEast,
        manner: Manner,
        config: PlannerConfig,
        travel_m: float,
    ) -> float:
        """Return what depth the steepest steady glide takes down and up; not less than asked."""
        angle_rad = config.primitives.glide_angle_max_rad
        try:
            found_m = self._travel_m(number, origin, goal_ne_m, manner, config, angle_rad)
        except ValueError:
            return travel_m  # so steep it does not get on against the current
        return max(found_m, travel_m)

    def _too_short(
        self, number: int, goal_ne_m: NorthEast, manner: Manner, length_m: float
    ) -> None:
        """Come where a glide does not fit: by swimming, after a flat climb if need be."""
        if self._here[2] > 0.0:
            self._add(number, *self._flat(0.0))
        if math.dist(self._truth()[:2], goal_ne_m) >= _SAME_PLACE_M:
            self._swim(number, goal_ne_m, manner)
        self._found.remarks.append(
            Remark(
                number,
                f"These {length_m:.3g} m are too short, or the water too shallow, for a glide; "
                "the robot swims.",
            )
        )

    def _follow(self, reference: Reference) -> None:
        """Glide, or swim along the surface, from turn to turn in the time that lies between."""
        for number, (before, turn) in enumerate(pairwise(turns_of(reference)), start=1):
            passed_s, depth_m = turn[0] - before[0], turn[3]
            if depth_m == 0.0 and self._here[2] == 0.0:
                speed = math.dist(before[1:3], turn[1:3]) / passed_s
                if speed == 0.0:
                    raise ValueError(f"waypoints.{number}: the robot cannot wait in a reference")
                self._swim(number, turn[1:3], Manner(swim_speed_m_s=speed))
                continue
            speed = abs(depth_m - self._here[2]) / passed_s
            if speed == 0.0:
                raise ValueError(
                    f"waypoints.{number}: it has the depth of the turn before; under water a robot"
                    " glides down or up"
                )
            config = _with_speed(self._config, "glide_speed_m_s", speed)
            self._add(number, *self._aimed(config, turn[1:]))

    def _profiles(self, mooring: Mooring) -> None:
        """Spiral down and up at a place until the time is over."""
        config, manner = self._config, self._design.manner
        config = _with_speed(config, "spiral_speed_m_s", manner.glide_speed_m_s)
        motion = config.primitives
        deep_m = self._usual_deep_m(manner)
        if manner.floor_clearance_m is not None:
            floor_m = float(self._site.floor_m(*mooring.place.ne_m))
            deep_m = min(deep_m, max(floor_m - manner.floor_clearance_m, 0.0))
        if deep_m < motion.depth_change_min_m:
            raise ValueError("content.place: the water is too shallow there for a profile")
        rise = 0.5 * (motion.spiral_rise_min_m_rad + motion.spiral_rise_max_m_rad)
        turns = max(1, round(deep_m / rise / (2.0 * math.pi)))
        turn_rad = 2.0 * math.pi * turns
        radius_m = 0.5 * (motion.spiral_radius_min_m + motion.spiral_radius_max_m)
        profile_s = 2.0 * deep_m / motion.spiral_speed_m_s + config.mission.turn_time_s
        number = len(self._waypoints) - 1
        for _ in range(max(1, round(mooring.duration_s / profile_s))):
            if drift.has_current(config):
                self._add(number, *self._flat(deep_m))
                self._add(number, *self._flat(0.0))
                if math.dist(self._here[:2], mooring.place.ne_m) > radius_m:
                    self._swim(number, mooring.place.ne_m, manner)
            else:
                for depth_m in (deep_m, 0.0):
                    leg = primitive.spiral(config, self._here, 0.0, radius_m, turn_rad, depth_m)
                    self._add(number, leg, drift.course_of(config, leg, self._begin))
            if len(self._found.legs) > LEGS_MAX:
                raise ValueError(f"content.duration_s: it takes more than {LEGS_MAX:,} legs")

    def _keep(self, stay: StationKeep, manner: Manner) -> None:
        """Stay at the surface until the time is over."""
        config = _with_speed(self._config, "swim_speed_m_s", manner.swim_speed_m_s)
        try:
            leg = primitive.keep(
                config, self._here, stay.radius_m, stay.duration_s, self._begin.time_s
            )
        except ValueError as error:
            raise ValueError(f"content.place: {error}") from error
        self._add(0, leg, drift.Course(self._begin, (0.0, 0.0)))

    def _time_rule(self, manner: Manner, config: PlannerConfig) -> Callable[[float], bool]:
        """Return whether a climb leads to the surface because it is time, by travelled depth."""
        speed, every_s = config.primitives.glide_speed_m_s, self._design.surfacing.every_s
        deep_m, began_s = self._usual_deep_m(manner), self._begin.time_s
        up_since_s = self._dive_began_s
        longer_s = (2.0 * (deep_m - manner.shallow_m) + deep_m) / speed

        def comes_up(passed_m: float) -> bool:
            nonlocal up_since_s
            now_s = began_s + passed_m / speed
            next_up_s = now_s + longer_s
            is_due = every_s is not None and next_up_s - up_since_s > every_s
            is_due = is_due or any(now_s < due <= next_up_s for due in self._due_s)
            if is_due:
                up_since_s = now_s + deep_m / speed
            return is_due

        return comes_up

    def _usual_deep_m(self, manner: Manner) -> float:
        return self._survey_deep_m if manner.deep_m is None else manner.deep_m

    def _floor_rule(
        self, manner: Manner, begin_ne_m: NorthEast, end_ne_m: NorthEast
    ) -> Callable[[float], float]:
        """Return the depth of a deep turn by where its descent begins along a line, m."""
        clearance_m, deep_m = manner.floor_clearance_m, self._usual_deep_m(manner)
        length_m = math.dist(begin_ne_m, end_ne_m)
        if clearance_m is None or length_m == 0.0:
            return lambda _along_m: deep_m
        reach_m = 2.0 * deep_m / math.tan(_angle_rad(manner, self._config))
        count = min(max(int(_LOOKS_A_YO * length_m / reach_m), _LOOKS_A_YO), _LOOKS_MAX)
        shares = np.linspace(0.0, 1.0, count)
        north = begin_ne_m[0] + shares * (end_ne_m[0] - begin_ne_m[0])
        east = begin_ne_m[1] + shares * (end_ne_m[1] - begin_ne_m[1])
        free_m = self._site.floor_m(north, east) - clearance_m

        def deep_at(along_m: float) -> float:
            first = int(along_m / length_m * (count - 1))
            last = math.ceil((along_m + reach_m) / length_m * (count - 1))
            return min(deep_m, float(free_m[min(first, count - 1) : last + 1].min()))

        return deep_at

    def _remark_depth(self, number: int, manner: Manner, deepest_m: float) -> None:
        usual_m = self._usual_deep_m(manner)
        if deepest_m < _MUCH_LESS * usual_m:
            text = f"The deepest turn is at {deepest_m:.2g} m instead of {usual_m:.3g} m."
            self._found.remarks.append(Remark(number, text))

    def _remark_angle(self, number: int, slope: float, asked_rad: float) -> None:
        flown_rad = math.atan(slope)
        if abs(flown_rad - asked_rad) > _SEEN_RAD:
            flown, asked = math.degrees(flown_rad), math.degrees(asked_rad)
            text = f"So that turns lie far enough apart, it glides at {flown:.0f}° instead of "
            self._found.remarks.append(Remark(number, f"{text}{asked:.0f}°."))

    def _truth(self) -> PositionNed:
        """Return where the robot really is."""
        north, east, down = self._here
        return north + self._begin.north_m, east + self._begin.east_m, down

    def _aimed(self, config: PlannerConfig, target: PositionNed) -> tuple[Leg, drift.Course]:
        """Return the glide that really leads to a place, and its course."""
        leg = primitive.glide(config, self._here, target)
        course = drift.course_of(config, leg, self._begin)
        if not drift.has_current(config):
            return leg, course
        for _ in range(AIMS):
            north, east, _ = drift.position_at(leg, course, 1.0)
            off_ne_m = target[0] - north, target[1] - east
            aim = (leg.end_ned[0] + off_ne_m[0], leg.end_ned[1] + off_ne_m[1], target[2])
            leg = primitive.glide(config, self._here, aim)
            course = drift.course_of(config, leg, self._begin)
        return leg, course

    def _flat(self, depth_m: float) -> tuple[Leg, drift.Course]:
        leg = primitive.dive(self._config, self._here, depth_m)
        return leg, drift.course_of(self._config, leg, self._begin)

    def _add(self, number: int, leg: Leg, course: drift.Course) -> None:
        self._here, self._begin = drift.after(self._config, leg, course)
        self._found.legs.append(leg)
        self._found.waypoint.append(number)
        if self._here[2] <= 0.0:
            self._here = (self._here[0], self._here[1], 0.0)
            self._dive_began_s = self._begin.time_s


def _manner(number: int, waypoint: Waypoint, design: Design) -> Manner:
    try:
        return waypoint.manner(design.manner)
    except ValueError as error:
        raise ValueError(
            f"waypoints.{number}: its shallow turn must be above its deep one"
        ) from error


def _angle_rad(manner: Manner, config: PlannerConfig) -> float:
    motion = config.primitives
    middle = 0.5 * (motion.glide_angle_min_rad + motion.glide_angle_max_rad)
    return middle if manner.glide_angle_rad is None else manner.glide_angle_rad


def _with_speed(config: PlannerConfig, name: str, speed_m_s: float | None) -> PlannerConfig:
    if speed_m_s is None:
        return config
    primitives = config.primitives.model_copy(update={name: speed_m_s})
    return config.model_copy(update={"primitives": primitives})


def way_there(
    config: PlannerConfig, robot_ne_m: NorthEast, waypoints: Sequence[Waypoint]
) -> Leg | None:
    """Return the swim from where the robot is to the first waypoint; None where it is there.

    Raises:
        ValueError: If the current is too strong to swim against.
    """
    return swim_to(config, robot_ne_m, waypoints[0].ne_m) if waypoints else None


def with_patience(config: PlannerConfig, way: Leg | None) -> PlannerConfig:
    """Return settings of a mission that also waits for the way to its first waypoint.

    A robot gives a mission up that takes much longer than its legs, and the way is none of them.
    """
    if way is None:
        return config
    mission = config.mission
    patience_s = mission.patience_s + mission.patience_factor * way.duration_s
    changed = mission.model_copy(update={"patience_s": min(patience_s, _PATIENCE_MAX_S)})
    return config.model_copy(update={"mission": changed})


def rules_of(config: PlannerConfig, design: Design, site: Site) -> PlannerConfig:
    """Return a planner's settings as they hold for a design: all the water, and no going stale.

    Args:
        config: What holds for the robot.
        design: Its rules of surfacing.
        site: The water.
    """
    changes: dict[str, object] = {
        "domain": site.water,
        "total_budget": _UNLIMITED,
        "round_budget": _UNLIMITED,
        "time_budget_s": 0.0,
        "satellite_bytes": 0,
        "mission": config.mission.model_copy(
            update={"draft_distance_m": _FAR_M, "draft_age_s": _LONG_S}
        ),
    }
    if design.surfacing.max_uncertainty_m is not None:
        changes["max_uncertainty_m"] = design.surfacing.max_uncertainty_m
    return config.model_copy(update=changes)
