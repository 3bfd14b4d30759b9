"""What the station knows of one robot right now."""

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from autonomy.arrays import FloatArray
from autonomy.planner.plan import Leg, PrimitiveKind
from db.query.fleet.deployments import DeploymentRecord
from db.query.fleet.robots import RobotRecord
from db.query.mission.plans import PlanRecord
from robot_link.channel_table import Announcement
from robot_link.messages import (
    LinkReport,
    LinkState,
    OnboardPlanState,
    PlanQueue,
    PlanReport,
    RobotMode,
    Sample,
    StateReport,
)
from robot_link.report import (
    ActuatorReport,
    CurrentReport,
    Reading,
    TargetReport,
    VehicleReport,
    VehicleWord,
)
from robot_link.station.gateway.address import (
    ACOUSTIC_CARRIER,
    CAMERA_CARRIER,
    SATELLITE_CARRIERS,
)
from robot_link.transport.opening import is_radio
from server.fleet.clock_fault import ClockFault
from server.fleet.routing import KnownLinks
from server.fleet.trail import Track

SURFACE_DEPTH_M = 0.3
"""A leg that ends above this brings the robot to the surface, where radio reaches it."""
FOLLOW_TARGET = "track_target"
"""Kind of the plans that follow a target; they have no legs."""
UNDER_WATER = (RobotMode.DIVING, RobotMode.GLIDING, RobotMode.SPIRALLING)
_WORDLESS = (ACOUSTIC_CARRIER, CAMERA_CARRIER)
_STAYS_UP = (RobotMode.IDLE, RobotMode.HOLDING)
_PREPARES = (RobotMode.SURFACED, RobotMode.TURNING, RobotMode.HOLDING)
_FOLLOWING = (RobotMode.TRACKING, RobotMode.SEARCHING)
_BEST_LINK_FIRST = (
    LinkState.LIVE,
    LinkState.SUBMERGED,
    LinkState.STALE,
    LinkState.MUTE,
    LinkState.PORT_CLOSED,
    LinkState.DISABLED,
    LinkState.NEVER_HEARD,
)


@dataclass(frozen=True, slots=True)
class SentFix:
    """A fix by cameras that was sent to a robot."""

    cameras: int
    measured_at: datetime
    """By the station's clock."""


@dataclass(frozen=True, slots=True, eq=False)
class PlanInHand:
    """The plan of a robot that concerns the operator now."""

    record: PlanRecord
    legs: tuple[Leg, ...]
    points: FloatArray
    """Trajectory of the legs, shape ``(n, 5)``: time s, north, east, down m, position std m."""
    round_text: str
    """Where its mission stands, such as "round 2 of 4"; "" for a plan of its own."""
    expected: FloatArray | None = None
    """Expected track, shape ``(n, 5)`` like ``points``; ``None`` where the legs are the promise."""
    expected_ends_s: tuple[float, ...] = ()
    """When each leg is expected to end, s since the start; empty where nobody knows."""
    swim_speed_m_s: float | None = None
    """At which the robot swims to where the plan begins; ``None`` for one that has no legs."""

    @property
    def plan_id(self) -> str:
        """Public id of the plan."""
        return self.record.id

    @property
    def state(self) -> str:
        """State of the plan, as in REST."""
        return self.record.state


@dataclass(frozen=True, slots=True)
class SatelliteStatus:
    """Where a robot's satellite link stands; made anew whenever something of it changes."""

    credits_today: int
    credits_per_day: int
    waits_for_budget: bool
    """Whether something is not sent because today's budget is spent."""
    next_session_at: datetime | None
    """When the robot is expected to speak next."""
    fault: str
    """What a person must see to, such as a gateway's refusal; empty if nothing."""

    @property
    def credits_left(self) -> int:
        """What may still be spent today."""
        return max(0, self.credits_per_day - self.credits_today)


@dataclass(frozen=True, slots=True)
class SurfaceFault:
    """Why the newest order to surface was not obeyed."""

    ordered_at: datetime
    text: str
    """One sentence for the operator."""


@dataclass(frozen=True, slots=True)
class DeploymentSuggestion:
    """What the station takes to have happened, for a person to confirm."""

    kind: str
    """``begin`` or ``end`` of a deployment."""
    at: datetime
    text: str
    """One sentence that asks."""


FIX_HOLDS = timedelta(seconds=2)
"""So long after a fix a robot says that it has one (``onboard.flight.navigation``)."""
_FIXES_KEPT = 32
"""Fixes that were sent: more than a state is old when it comes, at five a second."""
_LONG_AGO = datetime.min.replace(tzinfo=UTC)


@dataclass(slots=True)
class RobotStatus:
    """Newest of everything about one robot; changed on the station's event loop only."""

    record: RobotRecord
    track: Track
    state: StateReport | None = None
    plan_report: PlanReport | None = None
    plan_queue: PlanQueue | None = None
    """Newest word on the plan that waits on board; ``None`` of one in which none ever did."""
    target_report: TargetReport | None = None
    """Newest report on its target; ``None`` once it flies a plan that follows none."""
    current_report: CurrentReport | None = None
    """Newest word on what it believes of the current; ``None`` of one that never told."""
    actuator_report: ActuatorReport | None = None
    """Newest word on how its actuators follow, since the station started."""
    vehicle_report: VehicleReport | None = None
    """Newest report of a vehicle of another maker, since the station started."""
    vehicle_word: VehicleWord | None = None
    """The newest grave sentence of such a vehicle."""
    links: dict[str, LinkReport] = field(default_factory=dict)
    """Newest report of each link, by its URI, or by its carrier where the report names no URI."""
    satellite: SatelliteStatus | None = None
    """Where the satellite link stands; ``None`` for a robot without one."""
    disabled_links: frozenset[str] = frozenset()
    """Ports that the operator has disabled; see ``server.fleet.disabled_links``."""
    clock_fault: ClockFault | None = None
    """What is wrong with the robot's clock; ``None`` while it is right."""
    fixes_sent: deque[SentFix] = field(default_factory=lambda: deque[SentFix](maxlen=_FIXES_KEPT))
    """The newest fixes by cameras that were sent to it, in the order of sending."""
    surface_fault: SurfaceFault | None = None
    """Why the newest order to surface was not obeyed; ``None`` once the robot is up."""
    remembered: LinkReport | None = None
    """What the database knows of the link, until the robot is heard again."""
    derived: dict[str, Sample] = field(default_factory=dict[str, Sample])
    """Newest value of what is computed of measurements, by channel."""
    samples: dict[str, Sample] = field(default_factory=dict)
    """Newest sample by variable."""
    readings: dict[str, Reading] = field(default_factory=dict[str, Reading])
    """Newest reading by channel."""
    plan: PlanInHand | None = None
    driver: str = ""
    """Who drives it by hand; "" for nobody of this station."""
    next_plan: PlanRecord | None = None
    """What it keeps waiting behind the plan on board, by its own word."""
    mission_id: str | None = None
    deployment: DeploymentRecord | None = None
    """Which it is in now; ``None`` of a robot in the workshop, and of a recording."""
    ashore_since: datetime = _LONG_AGO
    """Of a robot in the workshop: since when it is there."""
    suggestion: DeploymentSuggestion | None = None
    announced: Announcement | None = None
    """The table of channels that it announced last; ``None`` of one that never did."""
    channel_faults: dict[int, str] = field(default_factory=dict[int, str])
    """What of that table contradicts the catalogue, a sentence for each number."""
    refused: int = 0
    """Values that were not believed since the station started."""
    impossible: dict[str, int] = field(default_factory=dict[str, int])
    """How many values of each channel were outside of what it can have, since then."""

    def at_station(self, told_at: datetime) -> datetime:
        """Return what the station's clock showed at a time that the robot told by its own clock.

        A robot whose clock was not compared yet is believed to have the station's.
        """
        radio = self.radio
        offset_s = None if radio is None else radio.clock_offset_s
        return told_at - timedelta(seconds=offset_s or 0.0)

    def fix_behind(self, state: StateReport) -> SentFix | None:
        """Return the fix of the cameras by which a robot can have said that it is fixed.

        It is the newest that was sent, of those not later than the state and at most ``FIX_HOLDS``
        older; None where nobody knows.
        """
        said_at = self.at_station(state.measured_at)
        known = [
            fix for fix in self.fixes_sent if said_at - FIX_HOLDS <= fix.measured_at <= said_at
        ]
        return max(known, key=lambda fix: fix.measured_at, default=None)

    @property
    def is_retired(self) -> bool:
        """Whether it is shown for its past alone."""
        return self.record.retired_at is not None

    @property
    def is_in_workshop(self) -> bool:
        """Whether it is between two deployments, or before its first."""
        return self.record.kind != "recorded" and self.deployment is None

    @property
    def link(self) -> LinkReport | None:
        """Report of the link by which the robot is reached best, ``None`` before the first."""
        best = best_link(self._reports)
        unheard = best is None or best.state is LinkState.NEVER_HEARD
        return self.remembered or best if unheard else best

    @property
    def _reports(self) -> list[LinkReport]:
        """Reports of the links that carry words; modem and cameras only measure where it is."""
        return [link for link in self.links.values() if link.carrier not in _WORDLESS]

    @property
    def link_state(self) -> LinkState:
        """What is known of the link to the robot."""
        link = self.link
        return LinkState.NEVER_HEARD if link is None else link.state

    @property
    def radio(self) -> LinkReport | None:
        """Report of the radio by which the robot is reached best, ``None`` before the first."""
        return best_link(link for link in self.links.values() if is_radio_carrier(link.carrier))

    @property
    def radio_state(self) -> LinkState:
        """What is known of the robot's radios: only these carry a dialogue."""
        radio = self.radio
        return LinkState.NEVER_HEARD if radio is None else radio.state

    @property
    def known_links(self) -> KnownLinks:
        """What is known of each kind of link, for the choice of one."""
        radio, satellite = self.radio, self.satellite_link
        has_radio = radio is not None or any(is_radio(uri) for uri in self.record.links)
        state = LinkState.NEVER_HEARD if radio is None else radio.state
        return KnownLinks(
            radio=state if has_radio else None,
            radio_heard_at=None if radio is None else radio.heard_at,
            satellite=None if satellite is None else satellite.state,
            satellite_heard_at=None if satellite is None else satellite.heard_at,
        )

    @property
    def satellite_link(self) -> LinkReport | None:
        """Report of the satellite link, ``None`` for a robot without one."""
        return best_link(link for link in self.links.values() if link.carrier in SATELLITE_CARRIERS)

    @property
    def heard_at(self) -> datetime | None:
        """When the robot was last heard on any link, as far as the database remembers."""
        heard = [link.heard_at for link in self._reports if link.heard_at is not None]
        if self.remembered is not None and self.remembered.heard_at is not None:
            heard.append(self.remembered.heard_at)
        return max(heard, default=None)

    @property
    def flies_no_target(self) -> bool:
        """Whether the robot says that it flies the plan in hand, and that follows no target."""
        report, hand = self.plan_report, self.plan
        if hand is None or report is None or report.state is not OnboardPlanState.RUNNING:
            return False
        return report.sha256 == hand.record.sha256 and hand.record.kind != FOLLOW_TARGET

    def is_up_since(self, moment: datetime) -> bool:
        """Tell whether the robot has come up for good since then, or was sent out anew."""
        state, plan = self.state, self.plan
        if state is not None and state.measured_at >= moment and state.mode in _STAYS_UP:
            return True
        running_at = None if plan is None else plan.record.running_at
        return running_at is not None and running_at > moment

    @property
    def leg_now(self) -> int | None:
        """Leg of the plan in hand that the robot says it flies."""
        report = self.plan_report
        if self.plan is None or report is None or report.state is not OnboardPlanState.RUNNING:
            return None
        return report.leg if report.sha256 == self.plan.record.sha256 else None

    @property
    def follows_under_water(self) -> bool:
        """Whether the robot follows a target at a depth at which no radio reaches it."""
        state, hand = self.state, self.plan
        if state is None or hand is None or self.leg_now is None:
            return False
        if state.mode not in _FOLLOWING or hand.record.kind != FOLLOW_TARGET:
            return False
        is_deep = hand.record.config["motion"]["depth_m"] > SURFACE_DEPTH_M
        return is_deep and not self.record.site.radio_under_water

    def leg_begins_at(self) -> datetime | None:
        """Predict when the robot begins, or began, the leg that it says it flies.

        One that was on the way to where its plan begins when it last said so, or lay still, has
        that way before it.
        """
        report, leg_now, hand, state = self.plan_report, self.leg_now, self.plan, self.state
        if report is None or leg_now is None or hand is None:
            return None
        if leg_now > 0 or state is None or not hand.legs or hand.swim_speed_m_s is None:
            return report.measured_at
        if state.mode is not RobotMode.IDLE and not self._prepares(hand.legs[0], state):
            return report.measured_at
        way_m = math.dist(state.position_ned[:2], hand.legs[0].start_ned[:2])
        swim_s = way_m / hand.swim_speed_m_s
        return max(report.measured_at, state.measured_at) + timedelta(seconds=swim_s)

    def next_surfacing(self) -> datetime | None:
        """Predict when a submerged robot will be heard, from the legs of the plan it flies."""
        begins_at, leg_now = self.leg_begins_at(), self.leg_now
        if self.plan is None or begins_at is None or leg_now is None:
            return None
        record = self.plan.record
        if record.kind == FOLLOW_TARGET and record.running_at is not None:
            return record.running_at + timedelta(seconds=record.document["account"]["duration_s"])
        remaining_s, ends_s = 0.0, self.plan.expected_ends_s
        for number, leg in enumerate(self.plan.legs[leg_now:], leg_now):
            begun_s = ends_s[number - 1] if ends_s and number else 0.0
            remaining_s += ends_s[number] - begun_s if ends_s else leg.duration_s
            if leg.end_ned[2] <= SURFACE_DEPTH_M:
                return begins_at + timedelta(seconds=remaining_s)
        return None

    def dives_at(self) -> datetime | None:
        """Predict when a robot goes under water that flies a plan; ``None`` if it stays up."""
        hand, leg_now, state = self.plan, self.leg_now, self.state
        if hand is None or leg_now is None or state is None or not 0 <= leg_now < len(hand.legs):
            return None
        leg = hand.legs[leg_now]
        return self.leg_begins_at() if leg.end_ned[2] > SURFACE_DEPTH_M else None

    @staticmethod
    def _prepares(leg: Leg, state: StateReport) -> bool:
        """Tell whether a robot that says this is still on its way to a leg, or waits before it."""
        swims_there = state.mode is RobotMode.SWIMMING and leg.kind is not PrimitiveKind.SWIM
        return state.mode in _PREPARES or swims_there

    @property
    def is_between_dives(self) -> bool:
        """Whether the robot says that it lies at the surface before a leg that begins there."""
        hand, leg, state = self.plan, self.leg_now, self.state
        if hand is None or leg is None or state is None or not 0 < leg < len(hand.legs):
            return False
        first = hand.legs[leg]
        return self._prepares(first, state) and first.start_ned[2] <= 0.0

    def begins_ne_m(self) -> tuple[float, float] | None:
        """Return where a new plan would begin: at this surfacing, else at the next."""
        hand, leg_now = self.plan, self.leg_now
        flies_legs = hand is not None and hand.record.kind != FOLLOW_TARGET
        if hand is not None and leg_now is not None and flies_legs and not self.is_between_dives:
            for leg in hand.legs[leg_now:]:
                if leg.end_ned[2] <= SURFACE_DEPTH_M:
                    return leg.end_ned[:2]
        return None if self.state is None else self.state.position_ned[:2]


def is_radio_carrier(carrier: str) -> bool:
    """Tell whether a carrier is a radio, on which station and robot speak back and forth."""
    return carrier not in SATELLITE_CARRIERS and carrier not in _WORDLESS


def best_link(links: Iterable[LinkReport]) -> LinkReport | None:
    """Return the report of the link that reaches the robot best; of equal ones a radio."""
    return min(
        links,
        key=lambda link: (
            _BEST_LINK_FIRST.index(link.state),
            not is_radio_carrier(link.carrier),
        ),
        default=None,
    )


def remembered_link(state: StateReport, *, radio_under_water: bool) -> LinkReport:
    """Return what a stored state says of the link to a robot that was not heard since."""
    dived = state.mode in UNDER_WATER and not radio_under_water
    return LinkReport(
        robot=state.robot,
        carrier="",
        state=LinkState.SUBMERGED if dived else LinkState.STALE,
        heard_at=state.received_at,
        rssi_dbm=None,
        frames_received=0,
        frames_bad=0,
    )
