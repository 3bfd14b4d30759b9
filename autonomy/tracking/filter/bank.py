"""Filter bank: several estimates of one target, weighed by how well they foretell its ranges.

A range does not tell on which side of its course the robot has the target, so the one true failure
of a single filter is an estimate mirrored across the line of motion, or to the robot's other side:
its distance is right and its place is not. The bank therefore

- follows the mirrored estimate too whenever the geometry cannot tell the sides apart, until one of
  the two explains the ranges better;
- believes ranges that contradict the estimate again and again more than the estimate, and starts
  anew from a ring of hypotheses around the robot, at the distance that was heard;
- does the same where the estimate runs away faster than the robot can swim.

With ``hypotheses = one`` nothing is split, and contradiction reopens the one filter on another
bearing. With the pursuit law alone (for teaching) it is the thesis's filter and nothing else: it
takes in every range, and contradiction is told but not acted upon.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.tracking.config import TrackingConfig
from autonomy.tracking.filter import hypothesis_kernel as hk
from autonomy.tracking.filter.filter_kernel import R_RANGE, pack_filter, start_covariance
from autonomy.tracking.filter.hypothesis import (
    Hypothesis,
    mirrored_across,
    ring,
    set_place,
    spread_place,
    start_velocity,
)

BIAS_SHARE = 0.05
"""Share of the newest range in the mean normalized innovation of a hypothesis."""
BIAS_LIMIT = 0.85
"""Mean normalized innovation beyond which ranges contradict a hypothesis; by chance its standard
deviation is 0.16."""
STUBBORN = 5
"""So many rejected ranges in a row that agree with one another contradict the estimate."""
NEGLIGIBLE = 1e-3
"""Weight below which a hypothesis is dropped."""
SURE = 0.9
"""Weight from which on a ring counts as resolved."""
LEAST_MIRROR_WEIGHT = 0.05
"""A mirrored hypothesis starts as likely as the estimate's own covariance says, but not less likely
than this: a covariance that was wrong about the side is too small."""
STRAIGHT_RAD = 0.35
"""A course that turned by more within ``STRAIGHT_S`` has told the sides apart."""
STRAIGHT_S = 4.0
BLIND = 1.5
"""The sides of the course cannot be told apart where the target is fewer standard deviations off
the course than this."""
SPLIT_PAUSE_S = 5.0
"""Time between two splits."""
PLACED = 0.5
"""A search ends where the standard deviation of the place is less than this share of the range."""
CERTAIN = 3.0
"""Standard deviations by which a target must seem faster than the robot to be doubted."""
NEXT_BEARING_RAD = 2.4
"""Step to the next bearing that a single filter tries: by the golden angle they never repeat."""
VAGUE = 0.8
"""A guess whose standard deviation exceeds this share of the range says nothing of the bearing."""
CHANGE_OF_MIND = 1.5
"""Another hypothesis must be so much likelier than the one that was followed to replace it."""


@dataclass(frozen=True, slots=True)
class BankInput:
    """What one step of time brought."""

    dt_s: float
    """Time since the step before; 0 at the first."""
    command: tuple[float, float]
    """Turn rate (rad/s) and acceleration (m/s2) that held since then."""
    heading_rad: float
    """Measured; NaN where none was."""
    speed_m_s: float
    """Measured; NaN where none was."""
    ranges_m: tuple[float, ...] = ()
    """Horizontal ranges measured at this time; each finite and not negative."""
    target_velocity_ne_m_s: tuple[float, float] | None = None
    """Where it is known."""


@dataclass(slots=True)
class Hearing:
    """What became of the ranges."""

    believed: int = 0
    rejected: int = 0
    silence_s: float = 0.0
    """Time since a range was believed."""
    streak: int = 0
    """Believed ranges since the last rejected one or the last failure of ranges."""
    run: int = 0
    """Rejected ranges in a row that agree with one another."""
    run_range_m: float = 0.0
    run_age_s: float = 0.0
    since_restart: int = 0
    """Ranges believed since then."""
    restarts: int = 0
    """How often the ranges contradicted all hypotheses."""
    since_split_s: float = SPLIT_PAUSE_S
    turned_rad: float = 0.0
    """How far the robot turned of late; forgotten over ``STRAIGHT_S``."""
    is_searching: bool = False
    """Whether the ranges contradicted the estimate, and no other is sure yet."""


@dataclass(slots=True)
class Bank:
    """Hypotheses of one target, the one to follow first.

    It depends on nothing but where it began and what each step brought, so that replaying the same
    steps gives the same bank.
    """

    config: TrackingConfig
    q: FloatArray
    hypotheses: list[Hypothesis]
    hearing: Hearing = field(default_factory=Hearing)

    @staticmethod
    def begin(
        config: TrackingConfig,
        relative_ne_m: tuple[float, float],
        heading_rad: float,
        speed_m_s: float,
        position_std_m: float,
        target_velocity_ne_m_s: tuple[float, float] = (0.0, 0.0),
    ) -> "Bank":
        """Return a bank with one hypothesis.

        Args:
            config: Noise, gate, and how many hypotheses there may be.
            relative_ne_m: First guess of robot minus target.
            heading_rad: Of the robot.
            speed_m_s: Of the robot.
            position_std_m: How well the guess is known, per axis.
            target_velocity_ne_m_s: First guess of how the target moves.

        Raises:
            ValueError: If a number is not finite or the standard deviation is not positive.
        """
        start = [*relative_ne_m, heading_rad, speed_m_s]
        numbers = [*start, position_std_m, *target_velocity_ne_m_s]
        if not (np.isfinite(numbers).all() and position_std_m > 0.0):
            raise ValueError("the bank must begin at finite numbers, position_std_m > 0")
        q = pack_filter(config)
        h = np.zeros(hk.SIZE)
        h[:4] = start
        h[hk.COVARIANCE : hk.VELOCITY] = start_covariance(position_std_m**2, q)
        start_velocity(h, q, target_velocity_ne_m_s)
        return Bank(config, q, [Hypothesis(h, 1.0)])

    def copy(self) -> "Bank":
        """Return a copy whose steps do not show in this one."""
        kept = self.hearing
        hearing = Hearing(*(getattr(kept, name) for name in Hearing.__slots__))
        return Bank(self.config, self.q, [one.copy() for one in self.hypotheses], hearing)

    @property
    def is_multiple(self) -> bool:
        """Whether more than one hypothesis may be followed."""
        return self.config.filter.hypotheses != "one" and not self.config.barrier.is_teaching

    @property
    def best(self) -> Hypothesis:
        """The hypothesis to follow."""
        return self.hypotheses[0]

    def step(self, given: BankInput) -> None:
        """Let time pass, then take in what was measured at its end."""
        self._pass_time(given)
        for one in self.hypotheses:
            hk.hear_own(one.h, given.heading_rad, given.speed_m_s, self.q)
        hear = self._hear_plainly if self.config.barrier.is_teaching else self._hear
        for range_m in given.ranges_m:
            hear(range_m)
        if given.ranges_m and self.is_multiple:
            self._tidy()
            self._split(given.target_velocity_ne_m_s)
        if given.ranges_m and self.hearing.is_searching:
            self._settle()
        elif given.ranges_m and given.target_velocity_ne_m_s is None:
            self._doubt(given.ranges_m[-1])

    def follow_instead(
        self,
        relative_ne_m: tuple[float, float],
        covariance_m2: tuple[float, float, float],
        velocity_ne_m_s: tuple[float, float],
    ) -> None:
        """Give up every estimate for one place, which somebody else is sure of.

        Args:
            relative_ne_m: Robot minus target.
            covariance_m2: Of that: north-north, north-east, east-east; positive definite.
            velocity_ne_m_s: Of the target.
        """
        h = self.best.h.copy()
        h[:2] = relative_ne_m
        set_place(h, *covariance_m2)
        start_velocity(h, self.q, velocity_ne_m_s)
        self.hypotheses = [Hypothesis(h, 1.0)]
        self.hearing.is_searching = False
        self.hearing.run = 0

    def _pass_time(self, given: BankInput) -> None:
        hearing, dt = self.hearing, given.dt_s
        known = given.target_velocity_ne_m_s or (math.nan, math.nan)
        silence = hearing.silence_s
        failing = silence if silence >= self.config.ranging.coast_after_s else 0.0
        hearing.streak = 0 if failing else hearing.streak
        for one in self.hypotheses:
            hk.pass_time(one.h, *given.command, dt, *known, failing, self.q)
            one.since_s += dt
        hearing.silence_s += dt
        hearing.run_age_s += dt
        hearing.since_split_s += dt
        hearing.turned_rad *= math.exp(-dt / STRAIGHT_S)
        hearing.turned_rad += given.command[0] * dt

    def _hear(self, range_m: float) -> None:
        """Weigh every hypothesis by a range, and correct those that can explain it."""
        if self.hearing.believed == 0 and self._begin(range_m):
            return
        gate = self.config.ranging.gate
        likelihoods: list[float] = []
        biases: list[float] = []
        is_believed = False
        for one in self.hypotheses:
            expected, variance = hk.expect(one.h, self.q)
            normalized = (range_m - expected) / math.sqrt(variance)
            clipped = min(max(normalized, -gate), gate)
            likelihoods.append(-0.5 * (clipped * clipped + math.log(variance)))
            biases.append(one.bias + BIAS_SHARE * (clipped - one.bias))
            if abs(normalized) > gate:
                continue
            is_believed = True
            hk.hear_range(one.h, range_m, one.since_s, self.q)
            one.since_s = 0.0
        if not is_believed:
            self._reject(range_m)
            return
        self._believe()
        for one, bias in zip(self.hypotheses, biases, strict=True):
            one.bias = bias
        self._weigh(likelihoods)
        if abs(max(self.hypotheses, key=lambda one: one.weight).bias) > BIAS_LIMIT:
            self._restart(range_m, NEXT_BEARING_RAD)

    def _hear_plainly(self, range_m: float) -> None:
        """Take in a range as the thesis's filter does, whatever it says."""
        one, gate = self.best, self.config.ranging.gate
        expected, variance = hk.expect(one.h, self.q)
        normalized = (range_m - expected) / math.sqrt(variance)
        one.bias += BIAS_SHARE * (min(max(normalized, -gate), gate) - one.bias)
        hk.hear_range(one.h, range_m, one.since_s, self.q)
        one.since_s = 0.0
        self._believe()
        if abs(one.bias) > BIAS_LIMIT:
            self.hearing.is_searching = True

    def _begin(self, range_m: float) -> bool:
        """Start from a ring where the first guess and the first range do not fit together."""
        one = self.best
        expected, variance = hk.expect(one.h, self.q)
        spread = math.sqrt(hk.worst_variance(one.h))
        agrees = abs(range_m - expected) <= self.config.ranging.gate * math.sqrt(variance)
        if agrees and (spread < VAGUE * range_m or not self.is_multiple):
            return False
        self._believe()
        self._restart(range_m)
        self.hearing.restarts = 0
        return True

    def _believe(self) -> None:
        self.hearing.believed += 1
        self.hearing.since_restart += 1
        self.hearing.streak += 1
        self.hearing.silence_s = 0.0
        self.hearing.run = 0

    def _reject(self, range_m: float) -> None:
        """Count a range that no hypothesis explains; a run of them reopens the gate."""
        hearing = self.hearing
        hearing.rejected += 1
        hearing.streak = 0
        reach = 2.0 * self.config.motion.speed_max_m_s * hearing.run_age_s
        reach += self.config.ranging.gate * math.sqrt(2.0 * self.config.ranging.variance_m2)
        agrees = hearing.run > 0 and abs(range_m - hearing.run_range_m) <= reach
        hearing.run = hearing.run + 1 if agrees else 1
        hearing.run_range_m, hearing.run_age_s = range_m, 0.0
        if hearing.run >= STUBBORN:
            self._believe()
            hearing.rejected -= 1
            self._restart(range_m)

    def _weigh(self, likelihoods: list[float]) -> None:
        most = max(likelihoods)
        for one, likelihood in zip(self.hypotheses, likelihoods, strict=True):
            one.weight *= math.exp(likelihood - most)
        self._normalize()

    def _normalize(self) -> None:
        total = sum(one.weight for one in self.hypotheses)
        for one in self.hypotheses:
            one.weight /= total

    def _restart(self, range_m: float, turn_rad: float = 0.0) -> None:
        """Give up every estimate: the target is at this distance, and its bearing is not known."""
        hearing, best = self.hearing, self.best
        hearing.restarts += 1
        hearing.is_searching = True
        hearing.since_restart = 0
        if not self.is_multiple:
            self._widen(range_m, turn_rad)
            return
        self.hypotheses = ring(best.h, range_m, self.q)
        self._normalize()

    def _widen(self, range_m: float, turn_rad: float) -> None:
        """Reopen a single filter at the distance that was heard, perhaps on another bearing."""
        one = self.best
        distance = math.hypot(one.h[0], one.h[1])
        angle = math.atan2(one.h[1], one.h[0]) if distance > 0.0 else 0.0
        angle += turn_rad
        one.h[0], one.h[1] = range_m * math.cos(angle), range_m * math.sin(angle)
        spread = range_m**2 + self.config.ranging.variance_m2
        spread_place(one.h, angle, self.config.ranging.variance_m2, spread)
        start_velocity(one.h, self.q)
        one.bias = 0.0

    def _tidy(self) -> None:
        """Join hypotheses that have come to mean the same and drop the unlikely; best first."""
        ranked = sorted(self.hypotheses, key=lambda one: -one.weight)
        kept: list[Hypothesis] = []
        for one in ranked:
            same = next((other for other in kept if hk.apart(one.h, other.h) < 1.0), None)
            if same is not None:
                same.weight += one.weight
            elif one.weight >= NEGLIGIBLE:
                kept.append(one)
        kept.sort(key=lambda one: -one.weight)
        followed = self.best
        is_close = followed in kept and kept[0].weight < CHANGE_OF_MIND * followed.weight
        if is_close and not self.hearing.is_searching:
            kept.remove(followed)
            kept.insert(0, followed)
        self.hypotheses = kept
        self._normalize()

    def _settle(self) -> None:
        """End the search once one hypothesis is likely, well placed and not contradicted."""
        best = self.best
        spread = math.sqrt(hk.worst_variance(best.h))
        distance = math.hypot(best.h[0], best.h[1])
        is_placed = spread < max(PLACED * distance, 2.0 * math.sqrt(self.q[R_RANGE]))
        is_agreed = abs(best.bias) < 0.5 * BIAS_LIMIT and self.hearing.since_restart >= STUBBORN
        if best.weight >= SURE and is_placed and (self.is_multiple or is_agreed):
            self.hearing.is_searching = False

    def _doubt(self, range_m: float) -> None:
        """Start anew where the target seems faster than the robot: it is more likely misplaced.

        A robot that chases an estimate hears nothing that contradicts it. While it circles, a
        target that really is faster shows in how its distance grows. A beacon that seems to move
        lies in water that flows.
        """
        may_flow = self.config.target.kind == "beacon"
        is_rejected = self.hearing.run > 0
        if self.config.barrier.is_teaching or may_flow or is_rejected:
            return
        std = math.sqrt(max(float(self.best.h[hk.RATE_VARIANCE]), 0.0))
        speed = math.hypot(*self.best.velocity_ne_m_s)
        if speed - CERTAIN * std > self.config.motion.speed_max_m_s:
            self._restart(range_m, NEXT_BEARING_RAD)

    def _split(self, known: tuple[float, float] | None) -> None:
        """Follow the mirrored estimate too where the ranges cannot tell the sides apart."""
        hearing, one = self.hearing, self.best
        is_straight = abs(hearing.turned_rad) < STRAIGHT_RAD
        is_due = is_straight and hearing.since_split_s >= SPLIT_PAUSE_S
        if len(self.hypotheses) > 1 or not is_due:
            return
        h = one.h
        north, east = known or one.velocity_ne_m_s
        course_n, course_e = h[3] * math.cos(h[2]) - north, h[3] * math.sin(h[2]) - east
        pace = math.hypot(course_n, course_e)
        if not pace > 0.0:
            return
        n_n, n_e = -course_e / pace, course_n / pace
        off = n_n * h[0] + n_e * h[1]
        nn, ne, ee = one.place_covariance_m2
        variance = n_n * n_n * nn + 2.0 * n_n * n_e * ne + n_e * n_e * ee
        mirrored = Hypothesis(mirrored_across(h, n_n, n_e, self.q), 0.0, one.bias, one.since_s)
        if off * off >= BLIND**2 * variance or hk.apart(h, mirrored.h) < 1.0:
            return
        mirrored.weight = max(math.exp(-2.0 * off * off / variance), LEAST_MIRROR_WEIGHT)
        self.hypotheses.append(mirrored)
        self._normalize()
        hearing.since_split_s = 0.0
