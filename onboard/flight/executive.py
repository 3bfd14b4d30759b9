"""The mission executive: flies the plan on board, keeps its limits, obeys commands."""

import math
from dataclasses import replace
from enum import Enum, auto

from autonomy.control.catalogue import CONTROLLERS
from autonomy.control.controller import Controller
from autonomy.planner.config import EnergyConfig
from autonomy.planner.plan import Leg, PrimitiveKind
from autonomy.vehicle.battery import RESERVE
from onboard.flight.account import EnergyAccount
from onboard.flight.actuator_watch import STUCK_S, ActuatorWatch
from onboard.flight.course import dive_ends, is_surface
from onboard.flight.drive import Driven
from onboard.flight.gentle import gait_for
from onboard.flight.hardware import Readings, SetPoints
from onboard.flight.keep import Keep
from onboard.flight.leg import begin_leg, first_course, upstream
from onboard.flight.maneuver import (
    Flight,
    Float,
    Gait,
    LegManeuver,
    Maneuver,
    Rise,
    Swim,
    Turn,
    carried,
    distance,
    nearest_inside,
)
from onboard.flight.navigation import Estimate
from onboard.flight.over_ground import GroundCourse, over_ground
from onboard.flight.safety import danger, mission_over, plan_flaw
from onboard.flight.surfacing import SurfacingWatch
from onboard.flight.trim import Trim
from onboard.link.robot_link import CommandOutcome
from onboard.profile import FlightProfile
from onboard.target.target_desk import TargetDesk
from robot_link.messages import (
    SURFACED_BY_COMMAND,
    CommandKind,
    OnboardPlanState,
    RobotMode,
)
from robot_link.mission import Mission
from robot_link.onboard_settings import DigestSettings

DIGITS = 12
"""Digits of a plan's hash that START names."""
MIND_EVERY_S = 1.0
"""Time between two looks at how the actuators follow."""
HOLDING_SHARE = 0.5
"""In a current of more than this part of its swimming speed the robot goes nowhere upstream."""
_TALK_MAX_S = 400.0
"""Longest stay at the surface for a call by satellite that does not end."""


class Stage(Enum):
    """Where the robot stands in its mission."""

    IDLE = auto()
    APPROACH = auto()
    """Swimming to the planned start of the next dive."""
    TURN = auto()
    """Turning towards the first leg of the next dive."""
    SURFACED = auto()
    """Waiting for a fix and, before a dive, for the station to acknowledge samples."""
    HELD = auto()
    LEG = auto()
    PURSUIT = auto()
    """Following a target."""
    NEXT = auto()
    """On the way to the surface, where the next dive begins."""
    ABORT = auto()
    """Coming up for good."""
    DRIVEN = auto()
    """Driven by hand, or coming up after that."""


_BEFORE_A_DIVE = (Stage.APPROACH, Stage.TURN, Stage.SURFACED)
_AT_A_SURFACING = (Stage.NEXT, Stage.PURSUIT, *_BEFORE_A_DIVE)


class Executive:
    """Decides what the robot does, one maneuver at a time.

    A *dive* is the legs from one surfacing to the next. Each begins with a turn towards its first
    leg and leads to its planned end, wherever the robot really starts. Between two dives the robot
    waits for a fix and until its samples are acknowledged, but not for long.

    Args:
        flight: The robot.
        energy: Prices of its primitives.
        period_s: Time between two steps.
        reckons_current: Whether the robot's position counts the current that it believes.
    """

    def __init__(
        self,
        flight: Flight,
        energy: EnergyConfig,
        period_s: float = 0.1,
        *,
        reckons_current: bool = False,
    ) -> None:
        self._flight = flight
        self._own_controller = flight.pilot.controller
        self._energy = energy
        self._prices = energy
        self._account = EnergyAccount(energy)
        self._reckons_current = reckons_current
        self._mission: Mission | None = None
        self._course = GroundCourse((), ())
        self._ends: tuple[int, ...] = ()
        self._stage = Stage.IDLE
        self._maneuver: Maneuver = Float(flight, RobotMode.IDLE)
        self._flown: LegManeuver | None = None
        self._hold = False
        self._period_s, self._minded_s = period_s, 0.0
        self.actuators = ActuatorWatch(flight.vehicle, period_s)
        """How the actuators follow their commands."""
        self.tracking = TargetDesk(period_s)
        """What is heard, done and told of a target, where the mission follows one."""
        self.rules = SurfacingWatch()
        """Rules of the mission that end a dive early."""
        self._abort_reason = ""
        self._mission_s = 0.0
        self._surfaced_s = 0.0
        self._kept_s = 0.0
        """Time of the stay at the surface, which this leg is, that is over."""
        self.plan_state = OnboardPlanState.NONE
        """State of the plan on board."""
        self.reason = ""
        """Why the plan failed, or why its last dive that ended early did; one sentence, or ""."""
        self.leg = 0
        """Leg being flown or next."""
        self.plans_begun = 0
        """How many plans were begun since the robot was switched on."""
        self.trim = Trim()
        """Trim of the mission that was started last."""

    @property
    def mode(self) -> RobotMode:
        """What the robot does."""
        return self._maneuver.mode

    @property
    def surfaced_s(self) -> float:
        """How long the robot has been at the surface; 0 under water."""
        return self._surfaced_s

    @property
    def energy_used(self) -> float:
        """Energy units spent since the mission began."""
        return self._account.used

    @property
    def digest_settings(self) -> DigestSettings | None:
        """What tells which samples change the map most, where the mission on board brought it."""
        onboard = None if self._mission is None else self._mission.onboard
        return None if onboard is None else onboard.digest_settings()

    @property
    def planned_current_ne_m_s(self) -> tuple[float, float] | None:
        """Current that the dive flown or next counts on; None where no plan tells of one."""
        currents = self._course.currents_ne_m_s
        running = self.plan_state is OnboardPlanState.RUNNING
        return currents[self.leg] if running and self.leg < len(currents) else None

    @property
    def is_sampling(self) -> bool:
        """Whether the field is worth measuring: a leg is being flown, or a target followed."""
        return self._stage in {Stage.LEG, Stage.PURSUIT}

    def plan_refusal(self) -> str:
        """Return why no new plan can be taken now, or ""."""
        if self.plan_state is OnboardPlanState.RUNNING:
            return "a mission is running: wait for its end, or surface the robot"
        return "the robot is coming up" if self._stage is Stage.ABORT else ""

    def take_plan(self, mission: Mission) -> None:
        """Replace the plan on board; it waits for START."""
        self._mission = mission
        self._course = (
            over_ground(mission.legs) if self._reckons_current else GroundCourse(mission.legs, ())
        )
        self._ends = dive_ends(mission.legs)
        self.plan_state = OnboardPlanState.ON_BOARD
        self.reason = ""
        self.leg = 0
        self._account = EnergyAccount(self._energy)

    @property
    def is_flying(self) -> bool:
        """Whether a plan is flown, and the robot is not coming up for good."""
        return self.plan_state is OnboardPlanState.RUNNING and self._stage is not Stage.ABORT

    @property
    def may_switch(self) -> bool:
        """Whether another plan may take the place of this one: at the surface, or at its end.

        A robot that is held waits where it is.
        """
        if self.plan_state is OnboardPlanState.DONE:
            return self._stage is Stage.IDLE
        is_between = self._stage in _AT_A_SURFACING or self._is_keeping
        return self.is_flying and self._surfaced_s > 0.0 and is_between and not self._hold

    def switch_refusal(self, mission: Mission) -> str:
        """Return why a plan that waits could not begin now, or ""."""
        flaw = plan_flaw(mission, self._flight.site, self._flight.vehicle.limits)
        return flaw or self._stuck_text()

    def switch_plan(self, mission: Mission) -> None:
        """End the plan on board where the robot is, at the surface, and begin another."""
        self._account.end_leg()
        self.tracking.end()
        self._enter(Stage.IDLE, Float(self._flight, RobotMode.SURFACED))
        self.take_plan(mission)
        self._start(mission.sha256())

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        """Act on a command; the same command again changes nothing."""
        running = self.plan_state is OnboardPlanState.RUNNING
        match kind:
            case CommandKind.SURFACE:
                if running:
                    self._abort(SURFACED_BY_COMMAND)
                self.end_drive()
                return CommandOutcome.DONE
            case CommandKind.HOLD | CommandKind.RESUME:
                if not running:
                    return CommandOutcome.NOT_NOW
                self._hold = kind is CommandKind.HOLD
                return CommandOutcome.DONE
            case CommandKind.QUIET | CommandKind.PING:
                self.tracking.obey(is_quiet=kind is CommandKind.QUIET)
                return CommandOutcome.DONE
            case CommandKind.START:
                return self._start(plan_digits)
            case CommandKind.ARM | CommandKind.DISARM | CommandKind.ZERO_DEPTH:
                return CommandOutcome.UNSUPPORTED  # the last is the program's, which has the sensor

    def begin_drive(self, estimate: Estimate) -> bool:
        """Let somebody drive the robot by hand; tell whether that is possible now."""
        if self._stage is Stage.IDLE and not self._stuck_text():
            self._flight.pilot.reset()
            self._enter(Stage.DRIVEN, Driven(self._flight, estimate, self._period_s))
        return self.driven is not None

    def end_drive(self) -> None:
        """Let nobody drive it any more; it comes up. Nothing happens where nobody does."""
        if self.driven is not None:
            self._enter(Stage.DRIVEN, Rise(self._flight))

    @property
    def driven(self) -> Driven | None:
        """The drive by hand under way."""
        return self._maneuver if isinstance(self._maneuver, Driven) else None

    def step(
        self,
        estimate: Estimate,
        dt_s: float,
        *,
        samples_waiting: int,
        is_talking: bool = False,
    ) -> SetPoints:
        """Return the set points for the next ``dt_s`` seconds, before trim.

        Args:
            estimate: Where the robot is.
            dt_s: Length of the step.
            samples_waiting: How many samples are not yet known to be stored ashore.
            is_talking: Whether a call by satellite is due or under way.
        """
        self._flight.pilot.begin_step()
        self._mind_actuators(estimate)
        if estimate.readings.battery_fraction < RESERVE:
            self.end_drive()
        is_surfaced = self._flight.is_surfaced(estimate)
        self._surfaced_s = self._surfaced_s + dt_s if is_surfaced else 0.0
        if self.plan_state is OnboardPlanState.RUNNING:
            self._mission_s += dt_s
            self._account.pass_time(dt_s)
            if self._flown is not None:
                self._account.fly_leg(self._flown.share(estimate))
            if isinstance(self._flown, Keep):
                self._kept_s = self._flown.passed_s
            self._keep_limits(estimate, samples_waiting)
        self.tracking.pass_time(estimate, dt_s)
        self._proceed(estimate, samples_waiting > 0, is_talking=is_talking)
        set_points = self._maneuver.step(estimate, dt_s)
        if self._stage is Stage.PURSUIT or self._is_keeping:
            amplitude, frequency = set_points.tail_amplitude_rad, set_points.tail_frequency_hz
            self._account.beat_tail(amplitude, frequency, dt_s)
        return set_points

    def _start(self, plan_digits: str) -> CommandOutcome:
        mission = self._mission
        if mission is None or not mission.sha256().startswith(plan_digits[:DIGITS] or "-"):
            return CommandOutcome.WRONG_PLAN
        if self.plan_state is OnboardPlanState.RUNNING:
            return CommandOutcome.DONE
        if self._stage is not Stage.IDLE:
            return CommandOutcome.NOT_NOW
        flaw = plan_flaw(mission, self._flight.site, self._flight.vehicle.limits)
        flaw = flaw or self._stuck_text()
        if flaw:
            self.plan_state, self.reason = OnboardPlanState.FAILED, flaw
            return CommandOutcome.NOT_NOW
        self.plan_state = OnboardPlanState.RUNNING
        self.plans_begun += 1
        self.trim = Trim.of(mission.settings)
        self._take_settings(mission)
        self.reason = ""
        self.leg = 0
        self._hold = False
        self._mission_s = self._kept_s = 0.0
        self._account = EnergyAccount(self._prices)
        self.tracking.begin(mission)
        self.rules.begin(mission.rules)
        self._enter(Stage.NEXT, Float(self._flight, RobotMode.SURFACED))
        return CommandOutcome.DONE

    def set_controller(self, controller: Controller) -> None:
        """Fly with this controller, except while a mission brings its own."""
        self._own_controller = controller
        if self._mission is None or self._mission.onboard is None:
            self._flight.pilot.controller = controller

    def set_profile(self, profile: FlightProfile) -> None:
        """Keep to these manners from the next maneuver on."""
        self._flight = replace(self._flight, profile=profile)

    def _take_settings(self, mission: Mission) -> None:
        """Fly with what the mission brought; what it does not bring is the robot's own."""
        pilot, onboard = self._flight.pilot, mission.onboard
        if onboard is None:
            pilot.controller, self._prices = self._own_controller, self._energy
            return
        kind = CONTROLLERS[onboard.controller_kind]
        pilot.controller = kind.make(self._flight.vehicle, onboard.controller_config())
        self._prices = onboard.energy_config()

    def watch_actuators(self, sent: SetPoints, readings: Readings) -> None:
        """Take what the actuators were told last, and what the sensors say since; before ``step``.

        Args:
            sent: Set points as they left, trim and end stops included.
            readings: Of the sensors as they are.
        """
        self.actuators.step(sent, readings, self._flight.pilot.wanted_pitch_rad)

    @property
    def gait(self) -> Gait:
        """How gently the legs are flown."""
        return self._flight.gait

    def _mind_actuators(self, estimate: Estimate) -> None:
        """Fly as the actuators allow; come up for good where one does not move any more."""
        watch, flight = self.actuators, self._flight
        running = self.plan_state is OnboardPlanState.RUNNING
        if running and self._stage is not Stage.ABORT and (stuck := self._stuck_text()):
            self._abort(stuck)
        self._minded_s += self._period_s
        if self._minded_s < MIND_EVERY_S:
            return
        self._minded_s = 0.0
        mass, is_swinging = watch.mass.belief, watch.is_swinging
        if mass.is_off or is_swinging:
            flight.pilot.know_mass(mass.rate_share, mass.delay_s)
        else:
            flight.pilot.forget_mass()
        gait = gait_for(flight.vehicle, flight.profile, mass, is_swinging=is_swinging)
        if not gait.is_near(flight.gait):
            self._flight = replace(flight, gait=gait)
            if self._stage is Stage.LEG and gait.speed_share < flight.gait.speed_share:
                self._fly_leg(estimate)

    def _stuck_text(self) -> str:
        """Say which actuator is stuck; "" for none."""
        stuck = self.actuators.stuck
        if not stuck:
            return ""
        name = stuck[0].value
        return f"the {name} is stuck: told to move, it stood still for {STUCK_S:.0f} s"

    def _keep_limits(self, estimate: Estimate, samples_waiting: int) -> None:
        """Come up where a limit is met: for this dive, or for good."""
        mission = self._mission
        if mission is None or self._stage is Stage.ABORT:
            return
        over = mission_over(mission.settings, self._mission_s, estimate)
        is_diving = self._stage is Stage.LEG and not (self._comes_up() or self._is_keeping)
        reason = danger(self._flight, mission.settings, estimate) if is_diving else ""
        is_under = is_diving and not self._flight.is_surfaced(estimate)
        reason = reason or self.rules.met(self._mission_s, samples_waiting, is_under_way=is_under)
        if over:
            self._abort(over)
        elif reason:
            self.reason = f"leg {self.leg + 1} ended early, {reason}"
            self._account.end_leg()
            self.leg = self._ends[self.leg] + 1
            self._enter(Stage.NEXT, Rise(self._flight))

    def _comes_up(self) -> bool:
        leg = self._legs[self.leg]
        return is_surface(leg.end_ned[2]) and not is_surface(leg.start_ned[2])

    def _abort(self, reason: str) -> None:
        self._account.end_leg()
        self._abort_reason = reason
        self.tracking.end()
        self._enter(Stage.ABORT, Rise(self._flight))

    def _proceed(self, estimate: Estimate, samples_waiting: bool, *, is_talking: bool) -> None:
        """Go on to the next stage if this one is over."""
        if self._hold and (self._stage in _BEFORE_A_DIVE or self._is_keeping):
            self._account.end_leg()
            self._enter(Stage.HELD, Float(self._flight, RobotMode.HOLDING))
        match self._stage:
            case Stage.IDLE:
                pass
            case Stage.NEXT:
                if self._flight.is_surfaced(estimate):
                    self._begin_dive(estimate)
            case Stage.HELD:
                if not self._hold:
                    self._begin_dive(estimate)
            case Stage.APPROACH:
                if self._maneuver.is_done(estimate):
                    self._turn(estimate)
            case Stage.TURN:
                if self._maneuver.is_done(estimate):
                    self._enter(Stage.SURFACED, Float(self._flight, RobotMode.SURFACED))
            case Stage.SURFACED:
                if self._may_set_out(estimate, samples_waiting, is_talking=is_talking):
                    self._set_out(estimate)
            case Stage.LEG:
                if self._maneuver.is_done(estimate):
                    self._end_leg(estimate)
            case Stage.PURSUIT:
                self._keep_up(estimate)
            case Stage.ABORT:
                if self._maneuver.is_done(estimate):
                    self._end_mission(OnboardPlanState.FAILED, self._abort_reason)
            case Stage.DRIVEN:
                if self._maneuver.is_done(estimate):
                    is_up = self._flight.is_surfaced(estimate)
                    self.end_drive()
                    if is_up:
                        self._enter(Stage.IDLE, Float(self._flight, RobotMode.IDLE))

    def _begin_dive(self, estimate: Estimate) -> None:
        """Prepare the dive that the next leg begins, or the pursuit, or end the mission."""
        if self.leg >= len(self._legs) and not self.tracking.is_wanted:
            self._end_mission(OnboardPlanState.DONE, "")
        elif self._hold:
            self._enter(Stage.HELD, Float(self._flight, RobotMode.HOLDING))
        elif self.tracking.is_wanted:
            self._enter(Stage.SURFACED, Float(self._flight, RobotMode.SURFACED))
        else:
            start = self._start_ne_m(estimate)
            if distance(estimate, start) > self._flight.profile.start_tolerance_m:
                self._enter(Stage.APPROACH, Swim(self._flight, start, estimate))
            else:
                self._turn(estimate)

    def _start_ne_m(self, estimate: Estimate) -> tuple[float, float]:
        """Return where to prepare the next dive: as far upstream as the water then carries it."""
        legs, profile = self._dive(), self._flight.profile
        if legs[0].kind is PrimitiveKind.KEEP:
            return legs[0].end_ned[:2]
        start = legs[0].start_ned[:2]
        believed = estimate.current.sure_ne_m_s
        if not 0.0 < math.hypot(*believed) < HOLDING_SHARE * profile.swimming_speed_m_s:
            return start
        start = upstream(start, legs, estimate, self._planned_ne_m_s)
        if legs[0].kind is not PrimitiveKind.SWIM:
            start = carried(start, estimate, -profile.turn_s)
        return nearest_inside(self._flight.site.domain, *start)

    def _keep_up(self, estimate: Estimate) -> None:
        """End or suspend the pursuit of a target if it is time to."""
        if self.tracking.failure:
            self._abort(self.tracking.failure)
        elif self._hold or self._maneuver.is_done(estimate) or self._is_unsure(estimate):
            self.tracking.pause()
            self._enter(Stage.NEXT, Rise(self._flight))

    def _is_unsure(self, estimate: Estimate) -> bool:
        """Tell whether a pursuit under water needs a fix before it may go on."""
        mission = self._mission
        if mission is None or self._flight.is_surfaced(estimate):
            return False
        return mission.settings.is_too_uncertain(estimate.position_std_m)

    def _turn(self, estimate: Estimate) -> None:
        """Turn towards the next leg that has a heading, if the dive does not begin by swimming."""
        legs = self._dive()
        flight = self._flight
        # a flat dive sinks with any heading, and keeps it
        headed = next((leg for leg in legs if leg.kind is not PrimitiveKind.DIVE), None)
        if headed is None or legs[0].kind in {PrimitiveKind.SWIM, PrimitiveKind.KEEP}:
            self._enter(Stage.SURFACED, Float(flight, RobotMode.SURFACED))
        else:
            self._enter(
                Stage.TURN, Turn(flight, lambda now: first_course(flight, legs, headed, now))
            )

    def _may_set_out(self, estimate: Estimate, samples_waiting: bool, *, is_talking: bool) -> bool:
        """Tell whether nothing keeps the robot any more where it waits at the surface."""
        if not estimate.has_fix:
            return False
        if self.tracking.stays_up:
            return True
        profile = self._flight.profile
        if self._surfaced_s < profile.surface_min_s:
            return False
        if is_talking and self._surfaced_s < _TALK_MAX_S:
            return False
        return not samples_waiting or self._surfaced_s > profile.surface_max_s

    def _set_out(self, estimate: Estimate) -> None:
        if self.leg < len(self._legs):
            self._begin_leg(estimate)
        elif self.tracking.is_wanted:
            self._enter(Stage.PURSUIT, self.tracking.pursue(self._flight, estimate))
        else:
            self._end_mission(OnboardPlanState.DONE, "")

    def _begin_leg(self, estimate: Estimate) -> None:
        leg = self._legs[self.leg]
        if leg.kind is PrimitiveKind.KEEP:
            self._account.end_leg()  # what it swims is charged as it is swum
        else:
            self._account.begin_leg(leg)
        self._flight.pilot.reset()
        self._fly_leg(estimate)

    def _fly_leg(self, estimate: Estimate) -> None:
        legs, kept_s = self._dive(), self._kept_s
        flown = begin_leg(self._flight, legs, estimate, self._planned_ne_m_s, kept_s)
        self._enter(Stage.LEG, flown)
        self._flown = flown

    @property
    def _is_keeping(self) -> bool:
        return isinstance(self._flown, Keep)

    def _end_leg(self, estimate: Estimate) -> None:
        self._account.fly_leg(1.0)
        self._account.end_leg()
        is_last_of_dive = self.leg == self._ends[self.leg]
        self.leg += 1
        self._kept_s = 0.0
        if not is_last_of_dive:
            self._begin_leg(estimate)
        elif self._flight.is_surfaced(estimate):
            self._begin_dive(estimate)
        else:
            self._enter(Stage.NEXT, Rise(self._flight))

    def _end_mission(self, state: OnboardPlanState, reason: str) -> None:
        self.plan_state = state
        self.reason = reason
        self.tracking.end()
        self._enter(Stage.IDLE, Float(self._flight, RobotMode.IDLE))

    def _enter(self, stage: Stage, maneuver: Maneuver) -> None:
        self._stage = stage
        self._maneuver = maneuver
        self._flown = None

    @property
    def _planned_ne_m_s(self) -> tuple[float, float]:
        return self.planned_current_ne_m_s or (0.0, 0.0)

    @property
    def _legs(self) -> tuple[Leg, ...]:
        return self._course.legs

    def _dive(self) -> tuple[Leg, ...]:
        """Return the next leg and those after it until the next surfacing."""
        return self._legs[self.leg : self._ends[self.leg] + 1]
