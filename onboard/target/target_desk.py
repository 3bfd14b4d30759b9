"""What a robot does about a target beside swimming: listens, remembers, answers, reports."""

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

import numpy as np

from autonomy.tracking.config import RangingConfig, TrackingConfig
from autonomy.tracking.phase import TargetPhase
from autonomy.tracking.reading import TrackerStep
from onboard.flight.maneuver import Flight
from onboard.flight.navigation import Estimate
from onboard.target.pursuit import Pursuit
from onboard.target.ranging import Hearing
from robot_link.messages import RobotId
from robot_link.mission import Mission
from robot_link.report import TargetEstimate, TargetReport

_SEED_DIGITS = 12
_LAST_WORD_S = 60.0
"""How long a robot still says that its pursuit has ended; a link may be down for some of it."""


class TargetDesk:
    """Keeps what outlasts one pursuit; a mission that was held goes on with it.

    The mission's time, and with it a virtual target, goes on while the robot is held; what it
    believes of the target is kept, and grows in doubt.

    Args:
        period_s: Time between two steps.
    """

    def __init__(self, period_s: float) -> None:
        self.is_quiet = False
        """Whether the robot was told not to ping."""
        self.remember_quiet: Callable[[bool], None] = lambda _: None
        """Keeps that while the robot is switched off."""
        self._period_s = period_s
        self._config: TrackingConfig | None = None
        self._hearing: Hearing | None = None
        self._pursuit: Pursuit | None = None
        self._held: Pursuit | None = None
        self._newest: TrackerStep | None = None
        self._before: TrackerStep | None = None
        self._is_over = False
        self._said_s = 0.0

    @property
    def is_wanted(self) -> bool:
        """Whether the mission follows a target and its time is not over."""
        config, hearing = self._config, self._hearing
        if config is None or hearing is None or self._is_over:
            return False
        return hearing.time_s < config.motion.duration_s - 0.5 * self._period_s

    @property
    def stays_up(self) -> bool:
        """Whether a target is followed at the surface, where the robot can always talk."""
        return self._config is not None and self._config.motion.depth_m <= 0.0

    @property
    def ranging(self) -> RangingConfig | None:
        """How ranges are taken; None where no target is followed."""
        return None if self._config is None else self._config.ranging

    @property
    def failure(self) -> str:
        """Why the pursuit under way fails, or ""."""
        return "" if self._pursuit is None else self._pursuit.failure

    def begin(self, mission: Mission) -> None:
        """Prepare for a mission that is started now; the noise on board comes from its hash."""
        self._config = self._hearing = self._pursuit = self._held = None
        self._newest = self._before = None
        self._is_over = False
        self._said_s = 0.0
        if mission.tracking is not None:
            generator = np.random.default_rng(int(mission.sha256()[:_SEED_DIGITS], 16))
            self._config = mission.tracking.config()
            self._hearing = Hearing(self._config, generator)
            self._hearing.is_quiet = self.is_quiet

    def pursue(self, flight: Flight, estimate: Estimate) -> Pursuit:
        """Return the pursuit from here on; one that was held goes on with what it believes.

        Raises:
            RuntimeError: If the mission follows no target.
        """
        config, hearing = self._config, self._hearing
        if config is None or hearing is None:
            raise RuntimeError("no target is to be followed")
        if self._held is not None:
            self._pursuit, self._held = self._held, None
            self._pursuit.resume(estimate)
            return self._pursuit
        self._before = self._newest
        self._pursuit = Pursuit(flight, config, hearing, estimate, self._period_s)
        return self._pursuit

    def located(self, estimate: Estimate) -> Estimate:
        """Return the estimate, with the position that a beacon's ranges give where it is better."""
        return estimate if self._pursuit is None else self._pursuit.located(estimate)

    def pause(self) -> None:
        """Stop pursuing and pinging, until ``pursue``."""
        if self._pursuit is not None:
            self._newest = _since_begin(self._pursuit.newest, self._before)
            # a beacon's place is the mission's word, whatever was heard
            is_beacon = self._config is not None and self._config.target.kind == "beacon"
            self._held = None if is_beacon else self._pursuit
        if self._hearing is not None:
            self._hearing.forget()
        self._pursuit = None

    def end(self) -> None:
        """Say from now on, but not for long, that the pursuit has ended."""
        self.pause()
        self._held = None
        self._is_over = True

    def pass_time(self, estimate: Estimate, dt_s: float) -> None:
        """Let time pass; the mission's begins with its first pursuit.

        A pursuit that is held is told where the robot is, hears nothing, and grows in doubt.
        """
        if self._is_over:
            self._said_s += dt_s
        elif self._hearing is not None and (self._pursuit or self._newest):
            self._hearing.pass_time(dt_s)
        if self._held is not None:
            self._held.wait(estimate, dt_s)

    def obey(self, *, is_quiet: bool) -> None:
        """Stop pinging, or ping again, from now on and in missions to come."""
        self.is_quiet = is_quiet
        self.remember_quiet(is_quiet)
        if self._hearing is not None:
            self._hearing.is_quiet = is_quiet

    def hear(self, range_m: float | None, age_s: float) -> None:
        """Note a slant range from outside, or a ping that nobody answered."""
        if self._hearing is not None and self._pursuit is not None:
            self._hearing.hear(range_m, age_s)

    def wants_range(self) -> int | None:
        """Return whom to ping now, or None."""
        if self._hearing is None or self._pursuit is None or self.is_quiet:
            return None
        return self._hearing.address

    def report(self, robot: RobotId, now: datetime, estimate: Estimate) -> TargetReport | None:
        """Return how the robot holds its target; None while it follows none.

        Args:
            robot: Its name.
            now: Its clock.
            estimate: Where it believes to be.
        """
        hearing, config = self._hearing, self._config
        step = self._newest
        if self._pursuit is not None:
            newest = self._pursuit.newest
            step = newest and _since_begin(newest, self._before)
        is_told = self._pursuit is not None or (self._is_over and self._said_s < _LAST_WORD_S)
        if hearing is None or config is None or step is None or not is_told:
            return None
        return TargetReport(
            robot=robot,
            measured_at=now,
            received_at=now,
            phase=TargetPhase.ENDED if self._is_over else step.phase,
            position_ne_m=estimate.position_ned[:2],
            hypotheses=tuple(
                TargetEstimate(
                    one.position_ne_m, one.velocity_ne_m_s, one.covariance_m2, one.weight
                )
                for one in step.hypotheses
            ),
            range_m=step.range_m,
            range_age_s=step.range_age_s,
            ranges_heard=step.ranges_heard,
            ranges_rejected=step.ranges_rejected,
            determinant_m2_s=step.determinant_m2_s,
            barrier=step.barrier,
            inverse_condition=step.inverse_condition,
            nominal=step.nominal,
            command=step.command,
            is_barrier_on=not config.barrier.is_teaching,
            is_feasible=step.is_feasible,
            is_quiet=self.is_quiet,
            true_ne_m=hearing.true_ne_m,
            is_too_fast=step.is_too_fast,
            speed_class=step.speed_class,
            delay_s=step.delay_s,
        )


def _since_begin(newest: TrackerStep | None, before: TrackerStep | None) -> TrackerStep | None:
    """Return the newest step, with the ranges of the pursuits before a hold counted too."""
    if newest is None or before is None:
        return newest or before
    return replace(
        newest,
        ranges_heard=newest.ranges_heard + before.ranges_heard,
        ranges_rejected=newest.ranges_rejected + before.ranges_rejected,
    )
