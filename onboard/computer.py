"""The robot's computer: the onboard program with its links, memory, parameters and log."""

import asyncio
import math
from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from autonomy.control.config import BACKSTEPPING_PRESETS, BacksteppingConfig
from autonomy.planner.config import PlannerConfig
from autonomy.planner.preset import PLANNER_PRESETS
from autonomy.site import Site
from autonomy.vehicle.config import Vehicle
from onboard.link.plan_store import MemoryPlanStore, resume
from onboard.link.robot_link import RobotLink
from onboard.link.sample_file import FileSampleLog
from onboard.link.waypoint_mission import WaypointRules
from onboard.log import FileLog, NoLog, OnboardLog
from onboard.memory import (
    FileCommandMemory,
    FilePlanStore,
    FileValues,
    FlownPlan,
    QuietOrder,
    new_log,
    read_key,
)
from onboard.node.client import NodeClient
from onboard.node.satellite import SatelliteClient
from onboard.own_camera_file import OwnCameraFileError, read_own_camera
from onboard.own_camera_listener import OwnCameraListener
from onboard.own_parameters import OwnParameters
from onboard.profile import FLIGHT_PROFILES
from onboard.program import OnboardProgram
from onboard.satellite.policy import CallLimits
from onboard.satellite.receiver import FileStore, MemoryStore, Receiver
from onboard.satellite.talk import SatelliteTalk, TalkSettings
from onboard.tag_listener import TagListener
from onboard.target.pinger import Pinger
from robot_link.clock import Clock
from robot_link.mavlink.signing import FileSigningMemory, Signing
from robot_link.messages import LogId, OnboardPlanState, RobotId, SystemId
from robot_link.sample_log import MemorySampleLog, SampleLog
from robot_link.satellite.config import SatelliteConfig
from robot_link.service.file_store import FolderFiles
from robot_link.transport.datagram import DatagramTransport

TimeAt = Callable[[float], datetime]
"""Tells the robot's time at a count of its counter."""
KEY_FILE = "robot.key"
"""The robot's key, in the folder of its memory."""
SIGNING_KEY_FILE = "signing.key"
"""The key that signs its MAVLink frames; without one they are not signed."""


class Computer:
    """Everything that runs on board of one robot but what steps the program.

    What was on board when the robot was switched off is on board again: the plan (which waits for
    START), the commands that acted, chunks of missions, changed parameters, and samples that are
    not known to be stored ashore.

    Args:
        robot: Its name.
        system: Its MAVLink system id.
        vehicle: Its model.
        site: Where it works.
        program: What flies it.
        radio: Its radio.
        clock: Its clock.
        memory: Folder of what it remembers; None forgets.
        satellite: Its satellite node, and its key; None without a modem.
        acoustic: The node of its acoustic modem; None without one.
        tag_receiver: The node of its receiver of acoustic tags; None without one.
        camera: The node of its own camera, and what its counts mean; None without one. What is
            known of camera and tank lies in its memory.
        satellite_config: How it uses its modem, as built; by default as the station assumes.
    """

    def __init__(
        self,
        robot: RobotId,
        system: SystemId,
        vehicle: Vehicle,
        site: Site,
        *,
        program: OnboardProgram,
        radio: DatagramTransport,
        clock: Clock,
        memory: Path | None,
        satellite: tuple[NodeClient, bytes] | None = None,
        satellite_config: SatelliteConfig | None = None,
        acoustic: NodeClient | None = None,
        tag_receiver: NodeClient | None = None,
        camera: tuple[NodeClient, TimeAt] | None = None,
    ) -> None:
        self.program = program
        started_at = clock.now()
        samples = _samples(memory, started_at)
        plans = MemoryPlanStore() if memory is None else FilePlanStore(memory / "plan")
        talk = None if satellite is None else _talk_settings(satellite_config or SatelliteConfig())
        self.log: OnboardLog = NoLog() if memory is None else _log_in(memory, started_at)
        parameters = _own_parameters(memory, vehicle, program, talk)
        if (mission := resume(plans)) is not None:
            program.take_plan(mission)
        self._flown = FlownPlan(None if memory is None else memory / "flown")
        _obey_kept_quiet(memory, program)
        if memory is not None:
            zero = FileValues(memory / "depth_zero.json")
            program.depth_zero.restore(zero.load(), zero.save)
        self._noted = program.executive.mode, program.executive.plan_state
        self._noted_plan = program.executive.plans_begun
        self.link = RobotLink(
            system,
            radio,
            clock,
            program,
            log=samples,
            plans=plans,
            parameters=parameters.table,
            files=None if memory is None else FolderFiles(memory / "log"),
            command_memory=None if memory is None else FileCommandMemory(memory / "commands.json"),
            signing=None if memory is None else _signing(memory, clock),
            waypoints=_waypoint_rules(vehicle, site),
        )
        """What the program talks through."""
        self.talk: SatelliteTalk | None = None
        """Its talk by satellite; None without a modem."""
        self._nodes: dict[str, NodeClient] = {}
        self._pinger: Pinger | None = None
        if acoustic is not None:
            self._nodes["acoustic"] = acoustic
            self._pinger = Pinger(program, acoustic, clock)
        self._tags: TagListener | None = None
        if tag_receiver is not None:
            self._nodes["tag receiver"] = tag_receiver
            self._tags = TagListener(robot, program, tag_receiver, self.link, clock, self.log)
        self._eye = None if camera is None else self._own_camera(*camera, memory)
        if satellite is not None and talk is not None:
            node, key = satellite
            self._nodes["satellite"] = node
            store = MemoryStore() if memory is None else FileStore(memory / "satellite")
            self.talk = SatelliteTalk(
                robot,
                system,
                key,
                client=SatelliteClient(node),
                receiver=Receiver(store, key, system),
                link=self.link,
                program=program,
                samples=samples,
                clock=clock,
                settings=talk,
                plans=plans,
                was_flown=self._flown.is_it,
                note=self.log.note,
            )

    async def run(self) -> None:
        """Talk until cancelled."""
        try:
            async with asyncio.TaskGroup() as group:
                group.create_task(self.link.run(), name="link")
                for name, node in self._nodes.items():
                    group.create_task(node.run(), name=f"{name} node")
                if self._pinger is not None:
                    group.create_task(self._pinger.run(), name="pinger")
                if self._tags is not None:
                    group.create_task(self._tags.run(), name="tag listener")
                if self._eye is not None:
                    group.create_task(self._eye.run(), name="own camera")
                    group.create_task(self._eye.watch(), name="own camera's state")
                if self.talk is not None:
                    group.create_task(self.talk.run(), name="satellite talk")
        finally:
            self.log.close()

    def _own_camera(
        self, node: NodeClient, time_at: TimeAt, memory: Path | None
    ) -> OwnCameraListener | None:
        """Return what finds the robot by its own camera; None, and why in the log, if nothing."""
        try:
            setup = read_own_camera(memory)
        except OwnCameraFileError as error:
            self.log.note(f"own camera is not used: {error}")
            return None
        self._nodes["camera"] = node
        return OwnCameraListener(self.program, node, setup, time_at, self.log)

    def step(self) -> None:
        """Let one period of the program pass; call it ten times a second of the robot."""
        self.program.step(self.link)
        if reason := self.program.fixes.due_reason(self.program.time_s):
            self.log.note(f"fixes are not taken: {reason}")
            self.link.say(f"Fixes are not taken: {reason}")
        executive = self.program.executive
        if executive.plans_begun != self._noted_plan:
            self._noted_plan = executive.plans_begun
            self._note_flight(executive.plan_state)
        told = executive.mode, executive.plan_state
        if told == self._noted:
            return
        before, self._noted = self._noted, told
        if before[0] is not told[0]:
            self.log.note(f"mode {executive.mode.name.lower()}")
        if before[1] is not told[1]:
            self._note_flight(executive.plan_state)
            reason = f": {executive.reason}" if executive.reason else ""
            self.log.note(f"plan {executive.plan_state.name.lower()}{reason}")

    def _note_flight(self, state: OnboardPlanState) -> None:
        if state is OnboardPlanState.RUNNING:
            self._flown.note(self.link.plan_hash)
        elif state is OnboardPlanState.ON_BOARD:
            self._flown.note(None)

    def report_state(self) -> None:
        """Tell the station where the robot and its target are believed to be, and write it down."""
        report = self.program.state_report()
        self.link.report_state(report)
        self.log.track(report)
        if (target := self.program.target_report()) is not None:
            self.link.report_target(target)
        if (current := self.program.due_current_report()) is not None:
            self.link.report_current(current)
        if (actuators := self.program.due_actuator_report()) is not None:
            self.link.report_actuators(actuators)
        condition = self.program.due_condition()
        self.link.announce(self.program.channel_table)
        if condition is not None:
            self.link.report_health(condition, report.measured_at)


def _own_parameters(
    memory: Path | None, vehicle: Vehicle, program: OnboardProgram, talk: TalkSettings | None
) -> OwnParameters:
    """Return the robot's parameters, those set that were changed before it was switched off."""
    values = None if memory is None else FileValues(memory / "parameters.json")
    return OwnParameters(
        vehicle,
        BACKSTEPPING_PRESETS.get(vehicle.key, BacksteppingConfig()),
        FLIGHT_PROFILES[vehicle.key],
        program.executive,
        talk,
        fix_depth_m=program.fixes.surface_depth_m,
        believe_fixes_to=program.believe_fixes_to,
        kept={} if values is None else values.load(),
        save=_forget if values is None else values.save,
    )


def _obey_kept_quiet(memory: Path | None, program: OnboardProgram) -> None:
    """Let a robot that was told not to ping stay silent, and remember what it is told."""
    quiet = QuietOrder(None if memory is None else memory / "quiet")
    tracking = program.executive.tracking
    tracking.obey(is_quiet=quiet.is_quiet)
    tracking.remember_quiet = quiet.note


def _talk_settings(config: SatelliteConfig) -> TalkSettings:
    return TalkSettings(
        CallLimits(config.radio_silence_s, config.session_period_s, config.messages_per_day),
        config.digest_bytes,
    )


def _signing(memory: Path, clock: Clock) -> Signing | None:
    """Return what signs the robot's frames, where it was given a key for that."""
    try:
        secret = read_key(memory / SIGNING_KEY_FILE)
    except FileNotFoundError:
        return None
    return Signing(secret, FileSigningMemory(memory / "signing.json"), clock)


def _waypoint_rules(vehicle: Vehicle, site: Site) -> WaypointRules:
    """Return how the robot flies the waypoints of other makers' ground stations."""
    motion = PLANNER_PRESETS.get(vehicle.key, PlannerConfig()).primitives
    return WaypointRules(
        site.origin_latitude_deg,
        site.origin_longitude_deg,
        swim_speed_m_s=motion.swim_speed_m_s,
        vertical_speed_m_s=motion.glide_speed_m_s,
        flattest_glide_deg=math.degrees(motion.glide_angle_min_rad),
        steepest_glide_deg=math.degrees(motion.glide_angle_max_rad),
        depth_max_m=site.water.depth_max_m,
    )


def _samples(memory: Path | None, started_at: datetime) -> SampleLog:
    """Return the memory of samples, which begins a log and still holds what is not ashore."""
    if memory is None:
        return MemorySampleLog(LogId(int(started_at.timestamp())))
    return FileSampleLog(memory / "samples", new_log(memory / "log-number", started_at))


def _log_in(memory: Path, started_at: datetime) -> FileLog:
    return FileLog(memory / "log", started_at)


def _forget(_values: dict[str, float]) -> None:
    """A robot without a disk keeps nothing."""
