"""The tracker: what a robot that follows a target by its range runs ten times a second.

One step takes what was measured, corrects the bank (late ranges at their own time), judges the
track, and commands: pursuit under the barrier while there is an estimate, a search while there is
none. Robot and target are seen from above; depth is the caller's, who gives horizontal ranges.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.site import Site
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.control import control_kernel
from autonomy.tracking.control.pack_control import pack_control
from autonomy.tracking.control.wall import Helm, Motion, WallGuard
from autonomy.tracking.filter import hypothesis_kernel as hk
from autonomy.tracking.filter.arbiter import Arbiter
from autonomy.tracking.filter.bank import Bank, BankInput
from autonomy.tracking.filter.filter_kernel import full_covariance
from autonomy.tracking.filter.joint import Belief
from autonomy.tracking.filter.late_range import Timeline
from autonomy.tracking.filter.track_watch import Evidence, TrackWatch
from autonomy.tracking.phase import TargetPhase
from autonomy.tracking.predictive.predictive import PredictiveController
from autonomy.tracking.reacquire import SearchCircle
from autonomy.tracking.reading import (
    LARGEST_M,
    Pair,
    RangeHeard,
    TargetHypothesis,
    TrackerReading,
    TrackerStart,
    TrackerStep,
)
from autonomy.tracking.weave import Weave

__all__ = [
    "RangeHeard",
    "TargetHypothesis",
    "Tracker",
    "TrackerReading",
    "TrackerStart",
    "TrackerStep",
]

LARGEST_SPEED_M_S = 50.0
LARGEST_HEADING_RAD = 1e6
LONGEST_STEP_S = 60.0
SLOW_RATIO, LEAST_LEVEL = 0.1, 0.1
"""A target below this share of the robot's cap does not move the barrier's level; the least share
of the level that is kept."""
JOINT_SEED = 4
"""The joint filter's random numbers are the same in every mission: the same ranges give the same
track."""


@dataclass(frozen=True, slots=True)
class _Control:
    command: Pair
    nominal: Pair
    determinant_m2_s: float
    barrier: float
    inverse_condition: float
    is_feasible: bool


@dataclass(frozen=True, slots=True)
class _Followed:
    z: tuple[float, float, float, float]
    """Relative position (robot minus target) north and east, m, heading, rad, and speed, m/s."""
    velocity_ne_m_s: Pair
    """Of the target."""
    belief: Belief | None
    """Of the joint filter, where that is followed."""


class Tracker:
    """Follows one target.

    The first guess of the target is ``config.target``'s place and ``guess_std_m``. A first range
    that contradicts it is believed, and the robot circles to find the bearing.

    Args:
        config: Of the whole mission.
        start: Where the robot is.
        helm: How it turns off a wall; by default as a unicycle within the mission's limits.

    Raises:
        ValueError: If a number of ``start`` is not finite or beyond all sense.
    """

    def __init__(
        self, config: TrackingConfig, start: TrackerStart, helm: Helm | None = None
    ) -> None:
        own = start.own_ne_m
        if not (_is_place(own) and _is_motion(start.heading_rad, start.speed_m_s)):
            raise ValueError(
                f"a tracker must start at finite own_ne_m within {LARGEST_M:.0f} m, heading_rad, "
                f"and speed_m_s within {LARGEST_SPEED_M_S:.0f} m/s, not {start}"
            )
        self._config = config
        self._p = pack_control(config)
        relative = (own[0] - config.target.north_m, own[1] - config.target.east_m)
        velocity = start.target_velocity_ne_m_s or (0.0, 0.0)
        bank = Bank.begin(
            config,
            relative,
            start.heading_rad,
            start.speed_m_s,
            config.target.guess_std_m,
            velocity,
        )
        self._timeline = Timeline(bank)
        is_judged = config.filter.hypotheses == "cloud" and not config.barrier.is_teaching
        is_judged = is_judged and config.filter.target_velocity == "estimated"
        chance = np.random.default_rng(JOINT_SEED)
        self._arbiter = Arbiter(config, start, chance) if is_judged else None
        self._weave = Weave(config)
        self._watch = TrackWatch(config)
        self._search = SearchCircle(config)
        self._predictive = self._new_predictive()
        self._now_s = 0.0
        self._own_ne_m = own
        self._command: Pair = (0.0, 0.0)
        motion = config.motion
        self._guard = WallGuard(helm or Helm(motion.turn_rate_max_rad_s), motion.margin_m)
        self._turn_rate_rad_s = 0.0
        self._heard = 0
        self._rejected = 0
        self._refused = 0
        """Of the ranges that were taken in, those that were not believed; never fewer."""
        self._newest: tuple[float, float] | None = None

    def step(self, reading: TrackerReading, dt_s: float) -> TrackerStep:
        """Let ``dt_s`` pass under the last command, take in what was measured, and command anew.

        Args:
            reading: What the robot knows now; numbers that are none are left out and counted.
            dt_s: Time since the step before, s; 0 at the first if it is at the start.

        Raises:
            ValueError: If ``dt_s`` is not a number from 0 to ``LONGEST_STEP_S``.
        """
        if not 0.0 <= dt_s <= LONGEST_STEP_S:
            raise ValueError(f"dt_s must be from 0 to {LONGEST_STEP_S:.0f} s, not {dt_s}")
        self._now_s += dt_s
        is_own_measured = _is_motion(reading.heading_rad, reading.speed_m_s)
        known = self._known_velocity(reading)
        given = BankInput(
            float(dt_s),
            self._command,
            float(reading.heading_rad) if is_own_measured else math.nan,
            float(reading.speed_m_s) if is_own_measured else math.nan,
            target_velocity_ne_m_s=known,
        )
        before = self._timeline.bank.best.h[hk.RECKONED :].copy()
        ranges = self._good(reading.ranges)
        self._rejected += self._timeline.step(given, ranges)
        self._move(reading.own_ne_m, before)
        if self._arbiter is not None:
            self._arbiter.step(self._now_s, self._own_ne_m, given, ranges, self._timeline)
        self._judge(dt_s, is_own_measured, reading.is_quiet)
        control = self._control(dt_s, known)
        self._command = control.command
        return self._answer(control, known)

    def applied(self, command: Pair) -> None:
        """Say that the robot does something else than what ``step`` commanded.

        Args:
            command: Turn rate rad/s and acceleration m/s2; left out if not finite.
        """
        if math.isfinite(command[0]) and math.isfinite(command[1]):
            self._command = (float(command[0]), float(command[1]))
            self._turn_rate_rad_s = self._command[0]

    def listen_again(self) -> None:
        """Judge the track anew: the robot did not listen for a while, which says nothing of it."""
        self._watch = TrackWatch(self._config)
        self._timeline.bank.hearing.silence_s = 0.0

    def keep_inside(self, step: TrackerStep, own_ne_m: Pair, site: Site) -> TrackerStep:
        """Turn away from walls and shore in time, whatever the track wants.

        Args:
            step: The newest answer of ``step``.
            own_ne_m: Where the robot is.
            site: The water that it may swim in.

        Returns:
            The same step; with another command where the robot could not keep ``motion.margin_m``
            off walls and shore any more (``wall``).
        """
        if step.phase in {TargetPhase.WAITING, TargetPhase.ENDED} or not _is_place(own_ne_m):
            return step
        h = self._timeline.bank.best.h
        pace = abs(float(h[3])) + 2.0 * math.sqrt(max(float(h[hk.SPEED_VARIANCE]), 0.0))
        now = Motion(own_ne_m, float(h[2]), pace, self._turn_rate_rad_s)
        command = self._guard.step(now, step.command, site)
        if command is None:
            return step
        self._command = command
        return replace(step, command=command)

    def _known_velocity(self, reading: TrackerReading) -> Pair | None:
        if self._config.filter.target_velocity == "estimated":
            return None
        if self._config.target.kind == "beacon":
            return (0.0, 0.0)
        velocity = reading.target_velocity_ne_m_s
        if velocity is None or not math.hypot(*velocity) <= LARGEST_SPEED_M_S:
            return None
        return (float(velocity[0]), float(velocity[1]))

    def _good(self, ranges: tuple[RangeHeard, ...]) -> tuple[RangeHeard, ...]:
        """Count ranges, and leave out those that are no distance or have no time."""
        good = tuple(heard for heard in ranges if heard.is_good)
        self._heard += len(ranges)
        self._rejected += len(ranges) - len(good)
        for heard in good:
            held_at = self._now_s - heard.age_s
            if self._newest is None or held_at >= self._newest[0]:
                self._newest = (held_at, heard.range_m)
        return good

    def _move(self, own_ne_m: Pair, before: FloatArray) -> None:
        """Take the robot's own position, or reckon it on from the last one."""
        if _is_place(own_ne_m):
            self._own_ne_m = own_ne_m
            return
        moved = self._timeline.bank.best.h[hk.RECKONED :] - before
        self._own_ne_m = (
            self._own_ne_m[0] + float(moved[0]),
            self._own_ne_m[1] + float(moved[1]),
        )

    def _judge(self, dt_s: float, is_own_measured: bool, is_quiet: bool) -> None:
        hearing, was = self._timeline.bank.hearing, self._watch.phase
        silence_s, streak = hearing.silence_s, hearing.streak
        is_searching = hearing.is_searching
        if self._arbiter is not None:
            heard = self._arbiter.heard
            silence_s, streak = min(silence_s, heard.silence_s), max(streak, heard.streak)
            is_searching = is_searching if self._arbiter.follows_bank else heard.is_searching
        self._watch.step(
            dt_s,
            Evidence(
                own_ne_m=self._own_ne_m,
                is_own_measured=is_own_measured,
                is_quiet=is_quiet,
                newest_range=self._newest,
                silence_s=silence_s,
                streak=streak,
                is_searching=is_searching,
            ),
        )
        if self._watch.phase is TargetPhase.LOST and was is not TargetPhase.LOST:
            self._search = SearchCircle(self._config)
            self._predictive = self._new_predictive()

    def _new_predictive(self) -> PredictiveController | None:
        is_predictive = self._config.barrier.controller.startswith("mpc_")
        return PredictiveController(self._config) if is_predictive else None

    def _control(self, dt_s: float, known: Pair | None) -> _Control:
        """Return the command for the estimate that is followed."""
        followed, phase = self._followed(known), self._watch.phase
        x_r, y_r, psi, v = followed.z
        vt_n, vt_e = followed.velocity_ne_m_s
        u1, u2, n1, n2, determinant, barrier, status = control_kernel.control_step(
            x_r, y_r, psi, v, vt_n, vt_e, 0.0, 0.0, self._levelled((vt_n, vt_e))
        )
        command = (u1, u2)
        if phase in {TargetPhase.WAITING, TargetPhase.ENDED}:
            command = (0.0, 0.0)
        elif self._searches(phase):
            command = self._search.command(v, dt_s)
        elif self._predictive is not None:
            P = self._covariance(followed.belief)
            command = self._predictive.command(np.array(followed.z), (vt_n, vt_e), P)
        elif followed.belief is not None:
            turn_rate = self._weave.turn_rate(self._now_s, followed.belief, self._own_ne_m, psi)
            command = (u1 if turn_rate is None else turn_rate, u2)
        if not (math.isfinite(command[0]) and math.isfinite(command[1])):
            command = (0.0, 0.0)
        condition = control_kernel.inverse_condition(x_r, y_r, psi, v, vt_n, vt_e)
        is_feasible = status < control_kernel.INFEASIBLE
        nominal = self._within((n1, n2))
        return _Control(command, nominal, determinant, barrier, condition, is_feasible)

    def _followed(self, known: Pair | None) -> _Followed:
        """Return the bank's best hypothesis, or what the joint filter believes instead."""
        best, arbiter = self._timeline.bank.best, self._arbiter
        if arbiter is None or arbiter.follows_bank:
            x_r, y_r, psi, v = (float(value) for value in best.h[:4])
            return _Followed((x_r, y_r, psi, v), known or best.velocity_ne_m_s, None)
        belief = arbiter.belief
        psi, v = (float(value) for value in arbiter.own)
        x_r = self._own_ne_m[0] - belief.place_ne_m[0]
        y_r = self._own_ne_m[1] - belief.place_ne_m[1]
        return _Followed((x_r, y_r, psi, v), belief.velocity_ne_m_s, belief)

    def _covariance(self, belief: Belief | None) -> FloatArray:
        """Return the covariance of what is followed, shape ``(4, 4)``."""
        P = full_covariance(self._timeline.bank.best.h[hk.COVARIANCE : hk.VELOCITY])
        if belief is not None:
            nn, ne, ee = belief.covariance_m2
            P[:2, :2] = [[nn, ne], [ne, ee]]
            P[:2, 2:] = P[2:, :2] = 0.0
        return P

    def _levelled(self, target_velocity_ne_m_s: Pair) -> FloatArray:
        """Return the controller's settings with the barrier's level for a target of this speed.

        Of the robot's speed only what the target leaves can be spent on going round it: the
        determinant that can be kept falls by that share.
        """
        if self._arbiter is None:
            return self._p
        ratio = math.hypot(*target_velocity_ne_m_s) / self._config.motion.speed_max_m_s
        share = min(max((1.0 - ratio) / (1.0 - SLOW_RATIO), LEAST_LEVEL), 1.0)
        self._p[control_kernel.EPSILON] = share * share * self._config.barrier.epsilon
        return self._p

    def _searches(self, phase: TargetPhase) -> bool:
        """Tell whether the robot circles, as nothing better is known."""
        if phase is not TargetPhase.LOST or self._config.barrier.is_teaching:
            return False
        arbiter = self._arbiter
        is_weaving = arbiter is not None and not arbiter.follows_bank
        is_silent = self._timeline.bank.hearing.silence_s > self._config.ranging.coast_after_s
        return not is_weaving or is_silent

    def _within(self, command: Pair) -> Pair:
        motion = self._config.motion
        turn = motion.turn_rate_max_rad_s
        low, high = motion.acceleration_min_m_s2, motion.acceleration_max_m_s2
        return (min(max(command[0], -turn), turn), min(max(command[1], low), high))

    def _answer(self, control: _Control, known: Pair | None) -> TrackerStep:
        bank = self._timeline.bank
        age = self._now_s - self._newest[0] if self._newest else 0.0
        rejected = bank.hearing.rejected
        if self._arbiter is not None and not self._arbiter.follows_bank:
            # what a misplaced bank refuses may have been believed
            rejected = min(rejected, self._arbiter.heard.rejected)
        self._refused = max(self._refused, rejected)
        belief = self._arbiter.belief if self._arbiter is not None and self._newest else None
        return TrackerStep(
            phase=self._watch.phase,
            command=control.command,
            nominal=control.nominal,
            hypotheses=self._hypotheses(known) if self._newest else (),
            determinant_m2_s=control.determinant_m2_s,
            barrier=control.barrier,
            inverse_condition=control.inverse_condition,
            is_feasible=control.is_feasible,
            ranges_heard=self._heard,
            ranges_rejected=self._rejected + self._refused,
            range_m=self._newest[1] if self._newest else None,
            range_age_s=max(age, 0.0),
            reason=self._watch.reason,
            note=self._watch.note,
            is_too_fast=belief is not None and belief.is_too_fast,
            speed_class=None if belief is None else belief.speed_class,
            delay_s=None if belief is None else belief.delay_s,
        )

    def _hypotheses(self, known: Pair | None) -> tuple[TargetHypothesis, ...]:
        """Return the hypothesis that is followed and the likeliest other one."""
        if self._arbiter is not None and not self._arbiter.follows_bank:
            belief = self._arbiter.belief
            place, velocity = belief.place_ne_m, belief.velocity_ne_m_s
            return (TargetHypothesis(place, velocity, belief.covariance_m2, 1.0),)
        bank = self._timeline.bank.hypotheses
        others = sorted(bank[1:], key=lambda one: -one.weight)[:1]
        chosen = [bank[0], *others]
        total = sum(one.weight for one in chosen)
        north, east = self._own_ne_m
        return tuple(
            TargetHypothesis(
                (north - float(one.h[0]), east - float(one.h[1])),
                known or one.velocity_ne_m_s,
                one.place_covariance_m2,
                one.weight / total,
            )
            for one in chosen
        )


def _is_place(ne_m: Pair) -> bool:
    return math.hypot(*ne_m) <= LARGEST_M


def _is_motion(heading_rad: float, speed_m_s: float) -> bool:
    return abs(heading_rad) <= LARGEST_HEADING_RAD and abs(speed_m_s) <= LARGEST_SPEED_M_S
