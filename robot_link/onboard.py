"""The robot's side of every service; what the onboard program talks through."""

from datetime import datetime
from enum import StrEnum
from typing import Protocol

from robot_link.clock import Clock
from robot_link.messages import (
    CommandKind,
    LogId,
    OnboardPlanState,
    PlanHash,
    PositionNed,
    RobotMode,
    StateReport,
    SystemId,
)
from robot_link.mission import Mission
from robot_link.transport.datagram import DatagramTransport


class CommandOutcome(StrEnum):
    """What the onboard program says to a command."""

    DONE = "done"
    NOT_NOW = "not_now"
    WRONG_PLAN = "wrong_plan"
    """START named a plan that is not on board."""
    UNSUPPORTED = "unsupported"


class RobotProgram(Protocol):
    """What the link asks of the onboard program; called on the loop, must return at once."""

    def plan_refusal(self) -> str:
        """Return why no new plan can be taken now (such as being under water), or ""."""
        ...

    def take_plan(self, mission: Mission) -> None:
        """Replace the plan on board; the new one waits for START."""
        ...

    def obey(self, kind: CommandKind, plan_digits: str) -> CommandOutcome:
        """Act on a command; ``plan_digits`` are the first 12 digits of START's plan, else ""."""
        ...


class SampleLog(Protocol):
    """The robot's memory of samples that are not yet stored ashore."""

    @property
    def log(self) -> LogId:
        """Name of this log; a program that starts with an empty memory takes a new one."""
        ...

    def append(self, sequence: int, frame_source: bytes) -> None:
        """Keep a sample."""
        ...


class PlanStore(Protocol):
    """The robot's memory of the plan on board."""

    def load(self) -> Mission | None:
        """Return the plan on board, None without one."""
        ...

    def replace(self, mission: Mission) -> None:
        """Make a mission the plan on board, whole or not at all."""
        ...


class RobotLink:
    """Heartbeat, state, samples, plan and commands of one robot; belongs to one event loop.

    Samples are kept and sent again until the station says that they are stored. Time-outs are
    wall seconds; time stamps are the caller's.
    """

    def __init__(
        self,
        system: SystemId,
        transport: DatagramTransport,
        clock: Clock,
        program: RobotProgram,
        *,
        log: SampleLog,
        plans: PlanStore,
    ) -> None:
        raise NotImplementedError

    async def run(self) -> None:
        """Serve until cancelled."""
        raise NotImplementedError

    def set_mode(self, mode: RobotMode) -> None:
        """Say what the robot does now; a change is sent at once, and then in each heartbeat.

        Announce a dive before the antenna goes under: silence after it counts as submerged.
        """
        raise NotImplementedError

    def report_state(self, state: StateReport) -> None:
        """Send a state once, unless the radio is busy; ``robot``, ``received_at`` do not travel."""
        raise NotImplementedError

    def record_sample(
        self,
        variable: str,
        value: float,
        position_ned: PositionNed,
        position_std_m: float,
        measured_at: datetime,
    ) -> int:
        """Keep a sample until it is stored ashore, and send it when the station is in reach.

        Returns:
            Its number in the log.

        Raises:
            ValueError: If a number is not finite.
            KeyError: If no such variable is declared.
        """
        raise NotImplementedError

    def report_plan(
        self, state: OnboardPlanState, *, leg: int = 0, energy_used: float = 0.0, reason: str = ""
    ) -> None:
        """Say how the plan on board fares; sent at once and every two seconds until changed."""
        raise NotImplementedError

    @property
    def plan_hash(self) -> PlanHash | None:
        """Hash of the plan on board."""
        raise NotImplementedError

    @property
    def unacknowledged_samples(self) -> int:
        """Samples not yet known to be stored ashore."""
        raise NotImplementedError
