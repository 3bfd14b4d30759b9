"""The mission document: what a plan becomes when it travels, and the hash that names it.

Both ends build the same canonical bytes (RFC 8949 deterministic CBOR of positional integers:
millimetres, milliseconds, milliradians), so the hash that a robot echoes proves that it holds
exactly this plan. MAVLink mission items carry the same integers, each exact in a float32.

Only the end of a leg travels: it begins where the one before it ended. Where a robot that aims off
in a current surfaces, its belief jumps to where it really is, and the next leg begins there; the
jump travels in the place of the circle, which only spirals have. A stay at the surface has no
heading; its radius travels in that place.

Format 3 also brings the robot its controller and the prices and kernel that the plan was made with;
format 2 has none of these, and format 1 no trim either. Format 4 has no legs: it brings the order
to follow a target instead. Format 5 is format 2 or 3 with rules by which the robot comes up early.
All are understood, and each keeps its bytes and so its name: a plan that was stored or is on board
stays what it was.
"""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Self, get_args, get_type_hints

import cbor2

from autonomy.planner.config import PlannerConfig
from autonomy.planner.plan import Leg, PositionNed, PrimitiveKind
from autonomy.vehicle.trim import TrimConfig
from robot_link.messages import PlanHash
from robot_link.onboard_settings import OnboardSettings
from robot_link.surfacing_order import SurfacingOrder
from robot_link.target_settings import TargetSettings

FORMAT_VERSION = 2
"""Format of new missions without onboard settings."""
ONBOARD_FORMAT = 3
"""Format of missions with onboard settings."""
TARGET_FORMAT = 4
"""Format of missions that follow a target."""
RULES_FORMAT = 5
"""Format of missions with rules by which the robot comes up early."""
_KINDS = (
    PrimitiveKind.GLIDE,
    PrimitiveKind.SPIRAL,
    PrimitiveKind.DIVE,
    PrimitiveKind.SWIM,
    PrimitiveKind.KEEP,
)
"""By the number that travels; robots that do not know the last refuse it by that number."""
_LOW, _HIGH = 0.5 - 2**24, 2**24 - 0.5
"""Between these, a rounded number is one that a float32 holds exactly."""
_GAP_M = 2e-3
"""Greatest distance between two ends that meet, a little more than rounding makes."""
_SURFACE_M = 1e-3
_SPIRAL, _KEEP = _KINDS.index(PrimitiveKind.SPIRAL), _KINDS.index(PrimitiveKind.KEEP)
SETTINGS_FIELDS = {1: 5, 2: 7, ONBOARD_FORMAT: 7, TARGET_FORMAT: 7, RULES_FORMAT: 7}
"""Integers of the settings in the canonical form, by format."""
ITEM_FIELDS = 10
"""Integers in one leg of the canonical form."""


@dataclass(frozen=True, slots=True)
class _Whole:
    """How a field travels: as the whole number next to the field times its scale."""

    title: str
    scale: float


@dataclass(frozen=True, slots=True)
class MissionSettings:
    """What the robot must know beside the legs; travels in the order of declaration."""

    sample_period_s: Annotated[float, _Whole("sample period", 1e3)]
    """Time between two field samples."""
    max_uncertainty_m: Annotated[float, _Whole("uncertainty", 1e3)]
    """The robot comes up when its horizontal position std exceeds this."""
    timeout_s: Annotated[float, _Whole("timeout", 1.0)]
    """The robot comes up and ends the mission after this time."""
    start_x_m: Annotated[float, _Whole("start x", 1e3)]
    """Northing where the first leg begins."""
    start_y_m: Annotated[float, _Whole("start y", 1e3)]
    """Easting where the first leg begins."""
    net_buoyancy_offset_kg: Annotated[float, _Whole("net buoyancy offset", 1e6)] = 0.0
    """Added to every set point of the net buoyancy; positive sinks."""
    mass_position_offset_m: Annotated[float, _Whole("mass position offset", 1e6)] = 0.0
    """Added to every set point of the sliding mass; positive moves it forward."""

    @classmethod
    def of(
        cls,
        planner: PlannerConfig,
        trim: TrimConfig,
        start: PositionNed,
        duration_s: float,
    ) -> Self:
        """Return the settings of a mission that is planned to take ``duration_s``.

        What the planner's settings and the trim have by the name of a field is taken over.
        """
        shared = _WHOLES.keys() & PlannerConfig.model_fields.keys()
        return cls(
            **{name: getattr(planner, name) for name in shared},
            sample_period_s=planner.primitives.point_interval_s,
            timeout_s=planner.mission.patience_factor * duration_s + planner.mission.patience_s,
            start_x_m=start[0],
            start_y_m=start[1],
            **trim.model_dump(),
        )

    @classmethod
    def from_integers(cls, integers: Sequence[int]) -> Self:
        """Return what integers say; the last fields, which are 0, may be left out."""
        scaled = zip(_WHOLES.items(), integers, strict=False)
        return cls(**{name: integer / whole.scale for (name, whole), integer in scaled})

    def integers(self) -> tuple[int, ...]:
        """Return the wire integers of all fields.

        Raises:
            ValueError: If a number does not fit; it is named.
        """
        numbers = {
            whole.title: getattr(self, name) * whole.scale for name, whole in _WHOLES.items()
        }
        return _rounded("the settings", numbers)

    def is_too_uncertain(self, position_std_m: float) -> bool:
        """Tell whether a position is less certain than the mission allows."""
        return position_std_m > self.max_uncertainty_m


_WHOLES: dict[str, _Whole] = {
    name: get_args(hint)[1]
    for name, hint in get_type_hints(MissionSettings, include_extras=True).items()
}


@dataclass(frozen=True, slots=True)
class Mission:
    """Settings and legs, quantized to what the wire can carry exactly.

    Build it with ``from_legs`` or ``for_target`` so that equality and hash hold on both sides of
    a link.
    """

    settings: MissionSettings
    legs: tuple[Leg, ...]
    format: int = FORMAT_VERSION
    """Which canonical form names it; format 1 has no trim."""
    onboard: OnboardSettings | None = None
    """What else the robot flies by, of formats 3 and 5; without it the robot has its own."""
    tracking: TargetSettings | None = None
    """What the robot follows, of format 4, which has no legs."""
    rules: SurfacingOrder | None = None
    """By what it comes up early, of format 5."""

    @classmethod
    def from_legs(
        cls,
        settings: MissionSettings,
        legs: tuple[Leg, ...],
        format_version: int | None = None,
        *,
        onboard: OnboardSettings | None = None,
        rules: SurfacingOrder | None = None,
    ) -> Self:
        """Quantize a plan's legs.

        Args:
            settings: What the robot must know beside the legs.
            legs: The legs, each from the end of the one before it.
            format_version: Which canonical form names it; by default the newest that its content
                needs.
            onboard: Settings of format 3 or 5.
            rules: Rules of format 5.

        Raises:
            ValueError: If a number does not fit the wire, the format is unknown or cannot carry
                the settings, or a leg does not begin where the one before it (the first: the
                start in the settings, at the surface) ends, for only the ends travel; the message
                names it. At the surface a leg that is no spiral may begin elsewhere.
        """
        version = FORMAT_VERSION if onboard is None else ONBOARD_FORMAT
        version = format_version or (version if rules is None else RULES_FORMAT)
        end: PositionNed = (settings.start_x_m, settings.start_y_m, 0.0)
        integers: list[tuple[int, ...]] = []
        for number, leg in enumerate(legs, start=1):
            jumps = math.dist(leg.start_ned, end) > _GAP_M
            if jumps and not (number > 1 and _may_jump(leg, end)):
                raise ValueError(f"leg {number} does not begin where the one before it ends")
            integers.append(leg_integers(leg, end if jumps else leg.start_ned))
            end = leg.end_ned
        rounded = _settings_integers(settings, version)
        if (rules is not None) != (version == RULES_FORMAT):
            raise ValueError(f"only format {RULES_FORMAT} of missions carries rules of surfacing")
        if (onboard is not None) != (version == ONBOARD_FORMAT) and rules is None:
            raise ValueError(f"only format {ONBOARD_FORMAT} of missions carries onboard settings")
        if version == TARGET_FORMAT:
            raise ValueError(f"format {TARGET_FORMAT} of missions has an order and no legs")
        return cls.from_integers(rounded, tuple(integers), onboard, rules=rules)

    @classmethod
    def for_target(cls, settings: MissionSettings, tracking: TargetSettings) -> Self:
        """Quantize the settings of a mission that follows a target.

        Args:
            settings: What the robot must know beside the order; the start is where it should be.
            tracking: The order.

        Raises:
            ValueError: If a number does not fit the wire; the message names it.
        """
        return cls.from_integers(_settings_integers(settings, TARGET_FORMAT), (), None, tracking)

    @classmethod
    def from_integers(
        cls,
        settings: tuple[int, ...],
        legs: tuple[tuple[int, ...], ...],
        onboard: OnboardSettings | None = None,
        tracking: TargetSettings | None = None,
        rules: SurfacingOrder | None = None,
    ) -> Self:
        """Rebuild a mission from its wire integers (see ``leg_integers``).

        Raises:
            ValueError: If they are none.
        """
        if tracking is not None and (legs or onboard is not None or rules is not None):
            raise ValueError(
                "a mission that follows a target has neither legs nor onboard settings nor rules"
            )
        if rules is not None and len(settings) == SETTINGS_FIELDS[RULES_FORMAT]:
            version = RULES_FORMAT
        else:
            version = _format_of(
                len(settings),
                has_onboard=onboard is not None or rules is not None,
                is_tracking=tracking is not None,
            )
        known = MissionSettings.from_integers(settings)
        start: PositionNed = (known.start_x_m, known.start_y_m, 0.0)
        rebuilt: list[Leg] = []
        for integers in legs:
            rebuilt.append(_leg(start, integers, may_jump=len(rebuilt) > 0))
            start = rebuilt[-1].end_ned
        return cls(
            settings=known,
            legs=tuple(rebuilt),
            format=version,
            onboard=onboard,
            tracking=tracking,
            rules=rules,
        )

    def settings_integers(self) -> tuple[int, ...]:
        """Wire integers of the settings: ms, mm, s, mm, mm, and from format 2 on mg, um."""
        return _settings_integers(self.settings, self.format)

    def leg_integers(self) -> tuple[tuple[int, ...], ...]:
        """Wire integers of every leg, ``ITEM_FIELDS`` each."""
        ends = [leg.end_ned for leg in self.legs[:-1]]
        starts = [leg.start_ned for leg in self.legs[:1]]
        return tuple(
            leg_integers(leg, end) for leg, end in zip(self.legs, (*starts, *ends), strict=True)
        )

    def canonical_bytes(self) -> bytes:
        """Return the bytes that the hash covers."""
        content: list[object] = [
            self.format,
            list(self.settings_integers()),
            [list(leg) for leg in self.leg_integers()],
        ]
        if self.onboard is not None or self.rules is not None:
            content.append([] if self.onboard is None else list(self.onboard.integers()))
        if self.tracking is not None:
            content.append(list(self.tracking.integers()))
        if self.rules is not None:
            content.append(list(self.rules.integers()))
        return cbor2.dumps(content, canonical=True)

    def sha256(self) -> PlanHash:
        """Return the name of this mission: SHA-256 of its canonical bytes."""
        return PlanHash(hashlib.sha256(self.canonical_bytes()).hexdigest())


def leg_integers(leg: Leg, end_before: PositionNed) -> tuple[int, ...]:
    """Quantize one leg; of its ends only the last travels.

    Args:
        leg: The leg.
        end_before: End of the leg before it; the leg's own start where there is none.

    Returns:
        ``(kind, x_mm, y_mm, z_mm, speed_mm_s, duration_ds, energy_milli, heading_mrad,
        radius_mm, turn_mrad)`` where x, y, z are the end of the leg. A leg that begins at the
        surface, but not where the one before it ended, has the jump north and east, mm, in the
        place of radius and turn; a stay at the surface has its radius, mm, in that of the heading.

    Raises:
        ValueError: If a number is not finite or exceeds what a float32 holds exactly.
    """
    named = {
        "x": leg.end_ned[0] * 1e3,
        "y": leg.end_ned[1] * 1e3,
        "z": leg.end_ned[2] * 1e3,
        "speed": leg.speed_m_s * 1e3,
        "duration": leg.duration_s * 10,
        "energy": leg.energy * 1e3,
        "heading": leg.heading_rad * 1e3,
        "radius": leg.radius_m * 1e3,
        "turn": leg.turn_rad * 1e3,
    }
    if leg.kind is PrimitiveKind.KEEP:
        named |= {"heading": leg.radius_m * 1e3, "radius": 0.0, "turn": 0.0}
    if _may_jump(leg, end_before) and leg.start_ned != end_before:
        named["radius"] = (leg.start_ned[0] - end_before[0]) * 1e3
        named["turn"] = (leg.start_ned[1] - end_before[1]) * 1e3
    return (_KINDS.index(leg.kind), *_rounded(f"a {leg.kind} leg", named))


def _may_jump(leg: Leg, end_before: PositionNed) -> bool:
    """Tell whether a leg may begin elsewhere than the one before it ended."""
    return leg.kind is not PrimitiveKind.SPIRAL and _is_surfacing(leg.start_ned, end_before)


def _is_surfacing(start: PositionNed, end_before: PositionNed) -> bool:
    return max(start[2], end_before[2]) < _SURFACE_M


def _format_of(settings: int, *, has_onboard: bool, is_tracking: bool) -> int:
    """Return the format of a mission with that many integers of settings."""
    if is_tracking and settings == SETTINGS_FIELDS[TARGET_FORMAT]:
        return TARGET_FORMAT
    if has_onboard and settings == SETTINGS_FIELDS[ONBOARD_FORMAT]:
        return ONBOARD_FORMAT
    for version in (1, FORMAT_VERSION):
        if not (has_onboard or is_tracking) and settings == SETTINGS_FIELDS[version]:
            return version
    raise ValueError(f"no format of missions has {settings} numbers of settings")


def _settings_integers(settings: MissionSettings, version: int) -> tuple[int, ...]:
    if version not in SETTINGS_FIELDS:
        raise ValueError(f"format {version} of missions is unknown")
    integers = settings.integers()
    count = SETTINGS_FIELDS[version]
    if any(integers[count:]):
        raise ValueError(f"format {version} of missions carries no trim")
    return integers[:count]


def _rounded(owner: str, named: dict[str, float]) -> tuple[int, ...]:
    for name, value in named.items():
        if not _LOW < value < _HIGH:  # nor if it is no number
            raise ValueError(f"{name} of {owner} is out of the wire's range")
    return tuple(map(round, named.values()))


def _leg(start: PositionNed, integers: tuple[int, ...], *, may_jump: bool) -> Leg:
    if len(integers) != ITEM_FIELDS:
        raise ValueError(f"a leg has {ITEM_FIELDS} numbers, not {len(integers)}")
    kind, x, y, z, speed, duration, energy, heading, radius, turn = integers
    if not 0 <= kind < len(_KINDS):
        raise ValueError(f"kind {kind} of a leg is unknown")
    if may_jump and kind != _SPIRAL and _is_surfacing(start, start):
        start = (start[0] + radius / 1e3, start[1] + turn / 1e3, start[2])
        radius = turn = 0
    if kind == _KEEP:
        if radius or turn:
            raise ValueError("a stay at the surface has no circle")
        heading, radius = 0, heading
    return Leg(
        kind=_KINDS[kind],
        start_ned=start,
        end_ned=(x / 1e3, y / 1e3, z / 1e3),
        speed_m_s=speed / 1e3,
        duration_s=duration / 10,
        energy=energy / 1e3,
        heading_rad=heading / 1e3,
        radius_m=radius / 1e3,
        turn_rad=turn / 1e3,
    )
