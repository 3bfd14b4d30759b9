"""The onboard program: ten times a second from readings to set points, never seeing the truth."""

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from datetime import datetime, timedelta
from typing import Protocol

from autonomy.channel import CHANNELS
from autonomy.control.config import BacksteppingConfig
from autonomy.estimation.config import EstimatorConfig
from autonomy.planner.config import EnergyConfig
from autonomy.site import Site
from autonomy.tracking.config import RangingConfig
from autonomy.vehicle.battery import RESERVE
from autonomy.vehicle.config import Vehicle
from onboard.flight.actuator_watch import Actuator, ActuatorBelief
from onboard.flight.depth_zero import ABOVE_MAX_M, DepthZero
from onboard.flight.executive import Executive
from onboard.flight.hardware import Hardware, Readings
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate, Navigator
from onboard.flight.outside_fix import FixSource, OutsideFixes
from onboard.flight.pilot import Pilot
from onboard.flight.water_track import CurrentBelief
from onboard.link.robot_link import CommandOutcome
from onboard.profile import FLIGHT_PROFILES
from robot_link.camera.received_fix import ReceivedFix
from robot_link.channel_table import ChannelTable, TableRow
from robot_link.drive import CENTRE, DriveReport, Stick
from robot_link.messages import (
    CommandKind,
    OnboardPlanState,
    PositionNed,
    RobotId,
    RobotMode,
    StateReport,
)
from robot_link.mission import Mission
from robot_link.onboard_settings import DigestSettings
from robot_link.report import ActuatorFollowing, ActuatorReport, CurrentReport, TargetReport

_ESTIMATED = ("roll_rad", "pitch_rad", "heading_rad")
_SENSED = tuple(
    field.name
    for field in fields(Readings)
    if field.name in StateReport.__dataclass_fields__ and field.name not in _ESTIMATED
)
"""What a state says as the sensors do."""
PERIOD_S = 0.1
"""Time between two steps of the program."""
_CURRENT_EVERY_S = 10.0
"""How often the robot says what it believes of the current; at once when a dive begins or ends."""


_ACTUATORS_EVERY_S = 10.0
"""How often the robot says how its actuators follow; at once when that changes how it flies."""
_ACTUATORS_LOOK_S = 1.0
_CONDITION_EVERY_S = 30.0
"""How often the robot says how it is itself; at once when a switch, such as a leak, changes."""
ActuatorNews = tuple[bool, bool, tuple[Actuator, ...]]


def _following(belief: ActuatorBelief) -> ActuatorFollowing:
    return ActuatorFollowing(
        belief.rate_share,
        belief.rate_std_octaves,
        belief.delay_s,
        belief.delay_std_s,
        belief.age_s if math.isfinite(belief.age_s) else None,
    )


class Radio(Protocol):
    """What the program says to the station; ``onboard.link.robot_link.RobotLink`` is one."""

    @property
    def unacknowledged_samples(self) -> int:
        """Samples not yet known to be stored ashore."""
        ...

    def set_mode(self, mode: RobotMode) -> None:
        """Say what the robot does from now on."""
        ...

    def report_state(self, state: StateReport) -> None:
        """Send a state once."""
        ...

    def record_sample(
        self,
        variable: str,
        value: float,
        position_ned: PositionNed,
        position_std_m: float,
        measured_at: datetime,
    ) -> int:
        """Keep a sample until it is stored ashore; return its number."""
        ...

    def report_plan(
        self, state: OnboardPlanState, *, leg: int = 0, energy_used: float = 0.0, reason: str = ""
    ) -> None:
        """Say how the plan on board fares."""
        ...

    def begin_next_plan(self) -> None:
        """Begin the plan that waits for this surfacing, if one does."""
        ...


class OnboardProgram:
    """Estimator, executive and pilot of one robot, and what it tells the station.

    Args:
        robot: Its name.
        vehicle: Its model.
        site: Where it works.
        estimator: Settings of its filters.
        controller: Gains of its controller.
        energy: Prices of its primitives.
        hardware: Its body.
        started_at: Its clock now.
        stamp: Tells the time by the robot's own clock; without it the steps are counted.
        current: What was learned of the current before; None as when a robot is switched on.
    """

    def __init__(
        self,
        robot: RobotId,
        vehicle: Vehicle,
        site: Site,
        *,
        estimator: EstimatorConfig,
        controller: BacksteppingConfig,
        energy: EnergyConfig,
        hardware: Hardware,
        started_at: datetime,
        stamp: Callable[[], datetime] | None = None,
        current: CurrentBelief | None = None,
    ) -> None:
        self._robot = robot
        self._stamp = stamp
        self.variable = site.variable
        """The field that is mapped here, a key of ``autonomy.channel``."""
        self._limits = vehicle.limits
        self._hardware = hardware
        self._started_at = started_at
        self._steps = 0
        self.depth_zero = DepthZero()
        """What its depth sensor reads at the surface."""
        self._readings = self.depth_zero.corrected(hardware.read())
        self._navigator = Navigator(estimator, vehicle, site, self._readings, PERIOD_S, current)
        self.fixes = OutsideFixes(site, estimator.surface_depth_m)
        """What somebody outside tells of its place."""
        pilot = Pilot(vehicle, controller, PERIOD_S)
        self.executive = Executive(
            Flight(vehicle, FLIGHT_PROFILES[vehicle.key], site, pilot),
            energy,
            PERIOD_S,
            reckons_current=estimator.method == "model",
        )
        self._set_points = pilot.rest()
        self._sent = self._set_points
        """Set points as they left, with trim and inside the end stops."""
        self.estimate: Estimate = self._read(0.0)
        self._sample_period_s = 0.0
        self._next_sample_s = 0.0
        self._next_asked_s: dict[str, float] = {}
        self._told_mode: RobotMode | None = None
        self._told_plan: tuple[OnboardPlanState, int, int, str] | None = None
        self._told_current: tuple[RobotMode, int] | None = None
        self._next_current_s = 0.0
        self._told_actuators: ActuatorNews | None = None
        self._next_actuators_s = self._next_actuators_look_s = 0.0
        self._next_condition_s = 0.0
        self._condition_keys: frozenset[str] = frozenset()
        self.newest_condition: tuple[Mapping[str, float], datetime] | None = None
        """What the robot last said of itself, and when."""
        self._told_switches: set[str] = set()
        self.is_talking = False
        """Whether a call by satellite is due or under way, for which the robot stays up."""

    @property
    def time_s(self) -> float:
        """Seconds since the program began."""
        return self._steps * PERIOD_S

    @property
    def now(self) -> datetime:
        """The robot's clock."""
        if self._stamp is not None:
            return self._stamp()
        return self._started_at + timedelta(seconds=self.time_s)

    @property
    def surfaced_s(self) -> float:
        """How long the robot has been at the surface; 0 under water."""
        return self.executive.surfaced_s

    @property
    def digest_settings(self) -> DigestSettings | None:
        """What tells which samples change the map most, where the mission on board brought it."""
        return self.executive.digest_settings

    def plan_refusal(self) -> str:
        """Return why no new plan can be taken now, or ""."""
        return self.executive.plan_refusal()

    def take_plan(self, mission: Mission) -> None:
        """Replace the plan on board; it waits for START."""
        self.executive.take_plan(mission)
        self._sample_period_s = mission.settings.sample_period_s

    @property
    def is_flying(self) -> bool:
        """Whether a plan is flown, and not just given up."""
        return self.executive.is_flying

    def switch_refusal(self, mission: Mission) -> str:
        """Return why a waiting plan could not begin at a surfacing now, or ""."""
        if self.estimate.readings.battery_fraction < RESERVE:
            return "the battery is below its reserve"
        return self.executive.switch_refusal(mission)

    def switch_plan(self, mission: Mission) -> None:
        """End the plan on board at a surfacing and begin another."""
        self.executive.switch_plan(mission)
        self._sample_period_s = mission.settings.sample_period_s

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        """Act on a command."""
        if kind is CommandKind.START and (self.estimate.readings.battery_fraction < RESERVE):
            return CommandOutcome.NOT_NOW
        if kind is CommandKind.ZERO_DEPTH:
            return self._zero_depth()
        return self.executive.obey(kind, plan_digits)

    def _zero_depth(self) -> CommandOutcome:
        """Take the depth sensor's reading as the surface, of a robot that lies still."""
        is_busy = self.is_flying or self.executive.mode is not RobotMode.IDLE
        if is_busy or not self.depth_zero.is_steady:
            return CommandOutcome.NOT_NOW
        if not self.depth_zero.take():
            return CommandOutcome.IMPLAUSIBLE
        self._next_condition_s = self.time_s
        return CommandOutcome.DONE

    def begin_drive(self) -> CommandOutcome:
        """Let somebody drive the robot by hand: not while a mission runs, nor on the reserve."""
        if self.estimate.readings.battery_fraction < RESERVE:
            return CommandOutcome.NOT_NOW
        is_driven = self.executive.begin_drive(self.estimate)
        return CommandOutcome.DONE if is_driven else CommandOutcome.NOT_NOW

    def end_drive(self) -> None:
        """Let nobody drive it any more."""
        self.executive.end_drive()

    def steer(self, stick: Stick) -> None:
        """Take where the pilot's stick is; nothing where nobody drives."""
        if (driven := self.executive.driven) is not None:
            driven.hear(stick)

    def drive_report(self, sequence: int) -> DriveReport:
        """Return what becomes of the newest stick; ``received_at`` is the receiver's to fill.

        Args:
            sequence: Number of the frame that brought it.
        """
        driven = self.executive.driven
        return DriveReport(
            robot=self._robot,
            measured_at=self.now,
            received_at=self.now,
            sequence=sequence,
            acts_on=CENTRE if driven is None else driven.acts_on,
            is_driven=driven is not None,
            is_silent=driven is not None and driven.is_silent,
            is_kept_off=driven is not None and driven.is_kept_off,
        )

    def hear_fix(self, fix: ReceivedFix) -> None:
        """Take where somebody outside saw the robot, or refuse it and count that."""
        self.fixes.hear(fix, self.now, self._readings.depth_m)

    def hear_own_fix(self, fix: ReceivedFix) -> None:
        """Take where the robot's own camera saw it to be, at whatever depth."""
        self.fixes.hear(fix, self.now, self._readings.depth_m, FixSource.OWN_CAMERA)

    def believe_fixes_to(self, depth_m: float) -> None:
        """Take fixes, of cameras outside and of its own sensor, where it is not deeper than this.

        Its own camera sees it at any depth.
        """
        self.fixes.surface_depth_m = depth_m
        self._navigator.believe_fixes_to(depth_m)

    def refuse_fix(self, reason: str) -> None:
        """Count a fix that is none, or is not for this robot."""
        self.fixes.refuse(reason)

    def hear_range(self, range_m: float | None, age_s: float) -> None:
        """Take a slant range of the target from outside, or None for a ping without an answer.

        Args:
            range_m: From the robot to the target, m; one that is no range is counted and rejected.
            age_s: How long ago it was measured.
        """
        self.executive.tracking.hear(range_m, age_s)

    def wants_range(self) -> int | None:
        """Return the acoustic address to ping now, or None."""
        return self.executive.tracking.wants_range()

    @property
    def ranging(self) -> RangingConfig | None:
        """How the mission takes ranges; None for one that follows no target."""
        return self.executive.tracking.ranging

    def target_report(self) -> TargetReport | None:
        """Return how the robot holds its target; None without a mission that follows one.

        ``received_at`` is the receiver's to fill.
        """
        return self.executive.tracking.report(self._robot, self.now, self.estimate)

    def current_report(self) -> CurrentReport:
        """Return what the robot believes of the current; ``received_at`` is the receiver's."""
        belief = self.estimate.current
        return CurrentReport(
            robot=self._robot,
            measured_at=self.now,
            received_at=self.now,
            current_ne_m_s=belief.current_ne_m_s,
            current_std_m_s=belief.std_m_s,
            doubt=belief.doubt,
            dives=belief.dives,
            fixes_refused=belief.fixes_refused,
        )

    def due_current_report(self) -> CurrentReport | None:
        """Return what the robot believes of the current, None where it said so a moment ago."""
        told = self.executive.mode, self.estimate.current.fixes_refused
        if told == self._told_current and self.time_s < self._next_current_s:
            return None
        self._told_current = told
        self._next_current_s = self.time_s + _CURRENT_EVERY_S
        return self.current_report()

    def actuator_report(self) -> ActuatorReport:
        """Return how the actuators follow; ``received_at`` is the receiver's to fill."""
        watch, gait = self.executive.actuators, self.executive.gait
        return ActuatorReport(
            robot=self._robot,
            measured_at=self.now,
            received_at=self.now,
            mass=_following(watch.mass.belief),
            pump=_following(watch.pump.belief),
            speed_share=gait.speed_share,
            is_mass_off=watch.mass.belief.is_off,
            is_swinging=watch.is_swinging,
            stuck=tuple(actuator.value for actuator in watch.stuck),
        )

    def due_actuator_report(self) -> ActuatorReport | None:
        """Return how the actuators follow, None where nothing new is to be said of it yet."""
        if self.time_s < self._next_actuators_look_s:
            return None
        self._next_actuators_look_s = self.time_s + _ACTUATORS_LOOK_S
        watch = self.executive.actuators
        told = (watch.mass.belief.is_off, watch.is_swinging, watch.stuck)
        if told == self._told_actuators and self.time_s < self._next_actuators_s:
            return None
        self._told_actuators = told
        self._next_actuators_s = self.time_s + _ACTUATORS_EVERY_S
        return self.actuator_report()

    def due_condition(self) -> Mapping[str, float] | None:
        """Return how the robot itself is, None where nothing new is to be said of it yet."""
        condition = self._condition()
        switches = {
            key for key, value in condition.items() if value and CHANNELS[key].kind == "switch"
        }
        is_due = switches != self._told_switches or self.time_s >= self._next_condition_s
        if not condition or not is_due:
            return None
        self._told_switches = switches
        self.executive.rules.hear(condition)
        self._condition_keys |= condition.keys()
        self.newest_condition = condition, self.now
        self._next_condition_s = self.time_s + _CONDITION_EVERY_S
        return condition

    def _condition(self) -> Mapping[str, float]:
        """Return readings of the robot's own condition, with the depth sensor's zero once set."""
        condition, offset_m = self._hardware.condition(), self.depth_zero.offset_m
        return condition if offset_m is None else {**condition, "depth_zero": offset_m}

    @property
    def channel_table(self) -> ChannelTable:
        """What the robot measures as it is equipped and told now."""
        period_s = {
            **dict.fromkeys(self._condition_keys, _CONDITION_EVERY_S),
            **self._hardware.instruments,
            self.variable: 0.0,  # as often as the mission says
        }
        named = ((CHANNELS[key], every_s) for key, every_s in period_s.items())
        return ChannelTable.of(
            TableRow(one.wire_number, one.key, one.unit, one.kind, every_s)
            for one, every_s in named
        )

    def step(self, radio: Radio) -> None:
        """Read, estimate, decide, act, measure and tell; call it every ``PERIOD_S``."""
        began_s = self.time_s
        self._steps += 1
        self.estimate = self.executive.tracking.located(self._read(began_s))
        self.executive.watch_actuators(self._sent, self._readings)
        self._set_points = self.executive.step(
            self.estimate,
            PERIOD_S,
            samples_waiting=radio.unacknowledged_samples,
            is_talking=self.is_talking,
        )
        self._sent = self.executive.trim.command(self._set_points, self._limits)
        self._hardware.actuate(self._sent)
        self._measure(radio)
        self._tell(radio)
        if self.executive.may_switch:
            radio.begin_next_plan()

    def state_report(self) -> StateReport:
        """Return what the robot believes of itself; ``received_at`` is the receiver's to fill.

        A sensor that reads a depth above the surface is told as it reads: its zero is wrong, which
        nobody would see otherwise.
        """
        estimate = self.estimate
        north, east, down = estimate.position_ned
        if self._readings.depth_m < -ABOVE_MAX_M:
            down = self._readings.depth_m
        roll, pitch, heading = estimate.state[3:6].tolist()
        return StateReport(
            robot=self._robot,
            measured_at=self.now,
            received_at=self.now,
            position_ned=(north, east, down),
            position_std_m=estimate.position_std_m,
            velocity_ned=estimate.velocity_ned,
            roll_rad=roll,
            pitch_rad=pitch,
            heading_rad=heading,
            mode=self.executive.mode,
            has_fix=estimate.has_fix,
            is_by_cameras=estimate.is_by_cameras,
            is_by_own_camera=estimate.fixed_by is FixSource.OWN_CAMERA,
            energy_used=self.executive.energy_used,
            **{name: getattr(self._readings, name) for name in _SENSED},
        )

    def _read(self, began_s: float) -> Estimate:
        """Read the sensors and return what the step that began then leads to."""
        self._readings = self.depth_zero.corrected(self._hardware.read())
        readings = self.executive.trim.in_model_terms(self._readings)
        self._navigator.expect_current(self.executive.planned_current_ne_m_s)
        # whoever made the program tells it the time only when it is made
        late = self.fixes.take(self.now) if self.fixes.are_waiting else None
        return self._navigator.step(readings, self._set_points, began_s, late)

    def _measure(self, radio: Radio) -> None:
        """Take the samples that are due on a leg or a pursuit: all of them at one place and time.

        Each instrument beside the planned field's is asked at its own rate.
        """
        if not self.executive.is_sampling:
            return
        measured: dict[str, float] = {}
        if self.time_s >= self._next_sample_s:
            self._next_sample_s = self.time_s + self._sample_period_s
            if (value := self._hardware.measure_field()) is not None:
                measured[self.variable] = value
        measured.update(self._hardware.measure(self._instruments_due()))
        if not measured:
            return
        self.executive.rules.hear(measured)
        now = self.now
        for channel, value in measured.items():
            radio.record_sample(
                channel, value, self.estimate.position_ned, self.estimate.position_std_m, now
            )

    def _instruments_due(self) -> list[str]:
        """Return the channels to ask now; they count as asked."""
        due: list[str] = []
        for channel, period_s in self._hardware.instruments.items():
            if channel != self.variable and self.time_s >= self._next_asked_s.get(channel, 0.0):
                self._next_asked_s[channel] = self.time_s + period_s
                due.append(channel)
        return due

    def _tell(self, radio: Radio) -> None:
        """Say at once what has changed."""
        executive = self.executive
        if executive.mode is not self._told_mode:
            self._told_mode = executive.mode
            radio.set_mode(executive.mode)
        plan = (
            executive.plan_state,
            executive.leg,
            executive.plans_begun,
            executive.reason,
        )
        if plan != self._told_plan:
            self._told_plan = plan
            radio.report_plan(
                executive.plan_state,
                leg=executive.leg,
                energy_used=executive.energy_used,
                reason=executive.reason,
            )
