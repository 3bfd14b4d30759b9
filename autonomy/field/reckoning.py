r"""How the position errors of the samples of one dive go together.

From fix to fix a robot reckons where it is. Its error is, on each horizontal axis, a random walk
(eddies, speeds that are not known well) and the way that a steady current carried it, of which
nothing is known but a standard deviation :math:`b`. Between moments :math:`t \le t'` after the fix
their covariance is

.. math::
    P(t, t') = w(t) + b^2 t t',

with :math:`w` the variance of the walk, that of the fix included. The fix at the end, :math:`T`,
tells the sum of both: what is left after smoothing is
:math:`P(t, t') - P(t, T) P(t', T) / (P(T, T) + r)` with the variance :math:`r` of that fix. So a
current is all but gone from a smoothed dive, and counts most in one that is under way.

A robot states the deviation :math:`f(t)`, of which the part that grows as :math:`t` is a current
that it knows to doubt; the rest is the walk. That what is stated may be wrong shows in the jumps,
by how much each fix moved the position: ``error_scale`` learns from them by how much walks are
longer than stated, how strong a current is that nobody told, and what of the robot's own doubt of
the current is true. The error of the fix itself is as stated.
"""

import math
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np

from autonomy.arrays import BoolArray, FloatArray, IntArray
from autonomy.estimation.config import FASTEST_CURRENT_M_S

if TYPE_CHECKING:
    from autonomy.field.samples import FieldSamples

_AT_REST = 1.05
"""Before it leaves, a robot states no more than this times the least deviation of the dive."""
_FEWEST_TO_SPLIT = 3
"""Samples of a dive from which on walk and current can be told apart."""
_SEEN = 0.5
"""Share of a dive that its samples must span to tell what was stated at its end."""
_TINY_M2 = 1e-24
_TINY_GAIN = 1e-12
"""A fix that moves nothing tells nothing of its jump."""
_SHORTEST_S = 1e-3
"""Samples within this time after the fix are at the fix."""
_LEAST_SHARE = 1e-9
_WALK_SPREAD = 0.5
"""Standard deviation of the logarithm of the walk's scale before any jump is known."""
_DOUBT_SPREAD = 2.0
"""The same of the factor of the robot's own doubt of the current: it may steer by a prior that it
never learns from."""
_WALKS = np.exp(np.linspace(math.log(0.2), math.log(5.0), 21))
_DOUBTS = np.exp(np.linspace(math.log(0.05), math.log(5.0), 9))
_CURRENTS = np.exp(np.linspace(math.log(0.03), math.log(30.0), 21))
"""Currents that are weighed, in the prior's standard deviation."""


@dataclass(frozen=True, slots=True)
class ErrorScale:
    """By how much position errors differ from what was stated."""

    walk: float = 1.0
    """Factor of the standard deviation of the walk."""
    current_m_s: float = 0.0
    """Standard deviation of the steady current on each axis; where a robot doubts the current more
    than that itself, its own doubt counts."""
    doubt: float = 1.0
    """Factor of that doubt."""


@dataclass(frozen=True, slots=True, eq=False)
class Reckoning:
    """What is known of the dives of ``n`` samples."""

    since_fix_s: FloatArray
    """Time since the fix that began the dive; 0 where not known, shape ``(n,)``."""
    current_std_m_s: FloatArray
    """Deviation of a steady current that the stated one counts already, shape ``(n,)``."""
    end_s: FloatArray
    """Time from that fix to the one that ended the dive; infinite where none did, ``(n,)``."""
    end_variance_m2: FloatArray
    """Stated variance of the jump at that fix, ``(n,)``; infinite where none ended the dive."""
    fix_variance_m2: FloatArray
    """Variance of that fix, shape ``(n,)``."""
    jump_ne_m: FloatArray
    """How far that fix lay from where the robot believed to be; not a number where not known,
    shape ``(n, 2)``."""
    carriage_std_m: FloatArray
    """Doubt of how far the water of the sample was carried since, which all samples share, for it
    is the doubt of one current; 0 where it was not carried, shape ``(n,)``."""

    def __getitem__(self, chosen: slice | IntArray | BoolArray) -> "Reckoning":
        """Return that of some of the samples, by slice, indices or mask."""
        return Reckoning(**{one.name: getattr(self, one.name)[chosen] for one in fields(self)})

    def followed_by(self, later: "Reckoning") -> "Reckoning":
        """Return that of these samples and of more."""
        return Reckoning(
            **{
                one.name: np.concatenate([getattr(self, one.name), getattr(later, one.name)])
                for one in fields(self)
            }
        )

    @classmethod
    def unknown(cls, count: int) -> "Reckoning":
        """Return that of samples of which nothing is known."""
        return cls(
            since_fix_s=np.zeros(count),
            current_std_m_s=np.zeros(count),
            end_s=np.full(count, np.inf),
            end_variance_m2=np.full(count, np.inf),
            fix_variance_m2=np.zeros(count),
            jump_ne_m=np.full((count, 2), np.nan),
            carriage_std_m=np.zeros(count),
        )


def reckoned(
    time_s: FloatArray,
    filtered_std_m: FloatArray,
    position_std_m: FloatArray,
    dive: IntArray,
    *,
    moved_ne_m: FloatArray | None = None,
    end_s: FloatArray | None = None,
    jump_ne_m: FloatArray | None = None,
) -> Reckoning:
    """Find out about dives what their samples show.

    A dive begins where the stated deviation leaves its least value. Without times everything is a
    walk.

    Args:
        time_s: When each was measured, shape ``(n,)``.
        filtered_std_m: Standard deviation that the robot stated, shape ``(n,)``.
        position_std_m: That of the smoothed position, shape ``(n,)``; the same where not smoothed.
        dive: Number of each sample's dive, shape ``(n,)``.
        moved_ne_m: How far smoothing moved each, shape ``(n, 2)``.
        end_s: When the fix came that ended the dive, on the clock of ``time_s``, shape ``(n,)``,
            not a number where none did; from the samples' own spacing if not given.
        jump_ne_m: How far that fix lay from the believed position, shape ``(n, 2)``; from
            ``moved_ne_m`` if not given.
    """
    found = Reckoning.unknown(len(time_s))
    for number in np.unique(dive):
        mine = np.flatnonzero(dive == number)
        mine = mine[np.argsort(time_s[mine], kind="stable")]
        told_end_s = math.nan if end_s is None else float(end_s[mine[0]])
        one = _OneDive.of(time_s[mine], filtered_std_m[mine], position_std_m[mine], told_end_s)
        found.since_fix_s[mine] = one.since_fix_s
        found.current_std_m_s[mine] = one.current_std_m_s
        found.end_s[mine] = one.end_s
        found.end_variance_m2[mine] = one.end_variance_m2
        found.fix_variance_m2[mine] = one.fix_variance_m2
        if jump_ne_m is not None:
            found.jump_ne_m[mine] = jump_ne_m[mine[0]]
        elif moved_ne_m is not None and one.is_smoothed.any() and one.end_s < math.inf:
            found.jump_ne_m[mine] = one.jump(moved_ne_m[mine])
    return found


@dataclass(frozen=True, slots=True, eq=False)
class _OneDive:
    since_fix_s: FloatArray
    current_std_m_s: float
    end_s: float
    end_variance_m2: float
    fix_variance_m2: float
    with_end_m2: FloatArray
    """Stated covariance of each sample's error with that at the end."""
    is_smoothed: BoolArray

    @classmethod
    def of(
        cls, time_s: FloatArray, stated_std_m: FloatArray, std_m: FloatArray, told_end_s: float
    ) -> "_OneDive":
        stated = np.square(stated_std_m)
        least = float(np.min(stated))
        rests = np.flatnonzero(np.logical_and.accumulate(stated <= _AT_REST**2 * least + _TINY_M2))
        left_s = float(time_s[rests[-1]]) if len(rests) else float(time_s[0])
        since = np.where(time_s - left_s > _SHORTEST_S, time_s - left_s, 0.0)
        rate, current = _growth(since, stated - least)
        current = min(current, _largest_current(since, stated))
        told = stated - np.square(std_m)
        is_smoothed = told > _LEAST_SHARE * stated
        longest = float(since[-1])
        end_s = told_end_s - left_s if math.isfinite(told_end_s) else math.inf
        if end_s == math.inf and is_smoothed.any() and longest > 0.0:
            end_s = longest + float(np.median(np.diff(time_s)))
        walk = stated - np.square(current * since)
        with_end = walk + (current**2 * since * end_s if end_s < math.inf else 0.0)
        variance = math.inf
        if is_smoothed.any():
            variance = float(np.median(np.square(with_end[is_smoothed]) / told[is_smoothed]))
        elif longest > _SEEN * end_s:
            variance = 2.0 * least + rate * end_s + (current * end_s) ** 2
        least_at_end = float(np.max(walk)) + ((current * end_s) ** 2 if end_s < math.inf else 0.0)
        variance = max(variance, least_at_end)
        fix = min(least, variance - least_at_end)  # a walk does not shrink before its end
        return cls(since, current, end_s, variance, fix, with_end, is_smoothed)

    def jump(self, moved_ne_m: FloatArray) -> FloatArray:
        """Return the jump that moved samples by so much, shape ``(2,)``."""
        gain = np.where(self.is_smoothed, self.with_end_m2 / self.end_variance_m2, 0.0)
        size = float(gain @ gain)
        return gain @ moved_ne_m / size if size > _TINY_GAIN else np.full(2, np.nan)


def _growth(since_s: FloatArray, grown_m2: FloatArray) -> tuple[float, float]:
    """Part the growth of a variance into that of a walk, m^2/s, and a current's deviation, m/s."""
    moving = since_s > 0.0
    if not moving.any():
        return 0.0, 0.0
    t, grown = since_s[moving], np.maximum(grown_m2[moving], 0.0)
    both = np.column_stack([t, np.square(t)])
    a, b = both.T @ both, both.T @ grown
    only_walk = float(b[0] / a[0, 0])
    if len(t) < _FEWEST_TO_SPLIT:
        return only_walk, 0.0
    determinant = float(a[0, 0] * a[1, 1] - a[0, 1] ** 2)
    if determinant <= _LEAST_SHARE * float(a[0, 0] * a[1, 1]):
        return only_walk, 0.0
    rate = float(a[1, 1] * b[0] - a[0, 1] * b[1]) / determinant
    square = float(a[0, 0] * b[1] - a[0, 1] * b[0]) / determinant
    if square <= 0.0:
        return only_walk, 0.0
    if rate < 0.0:
        return 0.0, math.sqrt(float(b[1] / a[1, 1]))
    return rate, math.sqrt(square)


def _largest_current(since_s: FloatArray, stated_m2: FloatArray) -> float:
    """Return the steady current that leaves every sample a walk."""
    moving = since_s > 0.0
    if not moving.any():
        return 0.0
    return float(np.min(np.sqrt(stated_m2[moving]) / since_s[moving]))


def error_scale(reckoning: Reckoning, dive: IntArray, prior_m_s: float) -> ErrorScale:
    r"""Learn from the jumps at fixes how far position errors are from what was stated.

    A jump is normal with variance :math:`k^2 w(T) + s^2 c^2 T^2 + 2 r` on each axis, with the
    robot's own doubt :math:`c` of the current; to it comes the way of a current that nobody told,
    of deviation :math:`b`: either one for all dives, or another in each, which is as likely. (Where
    it is another in each the greater of both doubts counts.) The factors :math:`k` of the walk and
    :math:`s` of the doubt are log-normal about 1 beforehand, :math:`b` half Cauchy with scale
    ``prior_m_s``; the means of the variances afterwards are what counts. Without any jump it is
    what was stated, and the prior's current.

    Args:
        reckoning: Of the samples.
        dive: Number of each sample's dive, shape ``(n,)``.
        prior_m_s: Standard deviation of the steady current of the water, m/s.
    """
    known = np.flatnonzero(np.isfinite(reckoning.jump_ne_m).all(axis=1))
    _, first = np.unique(dive[known], return_index=True)
    one = reckoning[known[first]]
    square = np.square(one.jump_ne_m).sum(axis=1)
    is_possible = np.isfinite(one.end_s) & np.isfinite(one.end_variance_m2)
    is_possible &= square <= np.square(FASTEST_CURRENT_M_S * one.end_s)
    one, square = one[is_possible], square[is_possible]
    if not len(square):
        return ErrorScale(1.0, prior_m_s)
    fix2, end2 = one.fix_variance_m2, np.square(one.end_s)
    doubt2 = np.square(one.current_std_m_s) * end2
    walk2 = np.maximum(one.end_variance_m2 - 2.0 * fix2 - doubt2, 0.0)
    jumps = _Jumps(one.jump_ne_m, one.end_s, walk2, doubt2, 2.0 * fix2 + _TINY_M2)
    return jumps.scale(prior_m_s)


@dataclass(frozen=True, slots=True, eq=False)
class _Jumps:
    """Jumps at the fixes of ``n`` dives, and what was stated of them, m^2."""

    jump_ne_m: FloatArray
    """Shape ``(n, 2)``, m."""
    end_s: FloatArray
    walk2: FloatArray
    doubt2: FloatArray
    fixes2: FloatArray

    def scale(self, prior_m_s: float) -> ErrorScale:
        """Weigh every scale on a grid, walk by doubt by current."""
        currents = _CURRENTS * prior_m_s if prior_m_s > 0.0 else np.zeros(1)
        doubts = _DOUBTS if self.doubt2.any() else np.ones(1)
        k2, s2 = np.square(_WALKS)[:, None, None], np.square(doubts)[None, :, None]
        b2 = np.square(currents)[None, None, :]
        prior = -0.125 * np.square(np.log(k2) / _WALK_SPREAD)
        prior = prior - 0.125 * np.square(np.log(s2) / _DOUBT_SPREAD)
        if prior_m_s > 0.0:
            prior = prior + np.log(_CURRENTS / (1.0 + np.square(_CURRENTS)))
        shared, met2 = self._one_current(k2, s2, b2)
        density = prior + np.stack([self._a_current_each(k2, s2, b2), shared])
        weight = np.exp(density - np.max(density))
        weight /= np.sum(weight)
        return ErrorScale(
            math.sqrt(float(np.sum(weight * k2))),
            math.sqrt(float(np.sum(weight[0] * b2) + np.sum(weight[1] * met2))),
            math.sqrt(float(np.sum(weight * s2))),
        )

    def _a_current_each(self, k2: FloatArray, s2: FloatArray, b2: FloatArray) -> FloatArray:
        """Return the log density if each dive meets a current of its own."""
        carried = np.maximum(b2[..., None] * np.square(self.end_s), s2[..., None] * self.doubt2)
        variance = k2[..., None] * self.walk2 + carried + self.fixes2
        square = np.square(self.jump_ne_m).sum(axis=1)
        return -np.sum(np.log(variance) + 0.5 * square / variance, axis=-1)

    def _one_current(
        self, k2: FloatArray, s2: FloatArray, b2: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the log density if one current is met by all, and what its square then is."""
        variance = (k2 * self.walk2 + s2 * self.doubt2 + self.fixes2)[:, :, None]  # (k, s, 1, n)
        square = np.square(self.jump_ne_m).sum(axis=1)
        density = -np.sum(np.log(variance) + 0.5 * square / variance, axis=-1)
        known = np.sum(np.square(self.end_s) / variance, axis=-1)
        left2 = b2 / (1.0 + b2 * known)  # the current's variance given the jumps
        seen2 = np.square((self.end_s / variance) @ self.jump_ne_m).sum(axis=-1)
        density = density - np.log1p(b2 * known) + 0.5 * left2 * seen2
        return density, left2 + 0.5 * np.square(left2) * seen2


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """The covariance of errors in parts: that of ``i`` and ``j`` is the sum of what both share."""

    walk: FloatArray
    """Variance of the walk, m^2."""
    carried: FloatArray
    """Deviation of the way that the current carried, m."""
    told: FloatArray
    """What the fix at the end tells, m; 0 where nothing was smoothed."""
    variance: FloatArray
    """Of the whole, m^2."""
    std: FloatArray
    """What is believed in the end, m."""
    group: IntArray
    """Errors of different groups have nothing in common."""
    shared: FloatArray
    """Error besides that all samples have in common, deviation in m."""


def located_std_m(samples: "FieldSamples", scale: ErrorScale) -> FloatArray:
    """Return the standard deviation of each horizontal position, shape ``(n,)``, m.

    With the scale 1 and no current it is the one stated, after smoothing the smoothed one.
    """
    errors = _errors(samples, scale)
    return np.hypot(errors.std, errors.shared) if errors.shared.any() else errors.std


def position_error_covariance(
    a: "FieldSamples", b: "FieldSamples", scale: ErrorScale | None = None
) -> FloatArray:
    """Return the covariance of the position errors of samples, on each horizontal axis.

    Samples of different dives are independent, and so are those of one dive of which only one was
    smoothed; but what is doubted of a carriage is one current's, and all samples share it.

    Args:
        a: ``n`` samples.
        b: ``m`` samples.
        scale: By how much errors differ from what was stated; as stated if not given.

    Returns:
        Shape ``(n, m)``, m^2. It is a covariance whatever a robot states.
    """
    scale = scale or ErrorScale()
    first = _errors(a, scale)
    second = first if b is a else _errors(b, scale)
    result = np.minimum.outer(first.walk, second.walk)
    result += np.multiply.outer(first.carried, second.carried)
    result -= np.multiply.outer(first.told, second.told)
    result *= np.multiply.outer(
        first.std / np.sqrt(first.variance), second.std / np.sqrt(second.variance)
    )
    result[np.not_equal.outer(first.group, second.group)] = 0.0
    if b is a:
        result[np.diag_indices(len(result))] = np.square(first.std)
    if first.shared.any() or second.shared.any():
        result += np.multiply.outer(first.shared, second.shared)
    return result


def _errors(samples: "FieldSamples", scale: ErrorScale) -> _Errors:
    known = samples.reckoning
    stated, smoothed = np.square(samples.filtered_std_m), np.square(samples.position_std_m)
    is_smoothed = (smoothed < stated * (1.0 - _LEAST_SHARE)) & np.isfinite(known.end_variance_m2)
    current2 = np.square(known.current_std_m_s)
    stated_walk = np.maximum(stated - current2 * np.square(known.since_fix_s), 0.0)
    own = _parts(known, stated_walk, current2)
    scaled2 = np.maximum(scale.doubt**2 * current2, scale.current_m_s**2)
    walk, carried, told = _parts(known, stated_walk, scaled2, scale.walk**2)
    told = np.where(is_smoothed, told, 0.0)
    total = walk + np.square(carried)
    variance = np.maximum(total - np.square(told), _LEAST_SHARE * total + _TINY_M2)
    before_total = own[0] + np.square(own[1])
    before = np.maximum(before_total - np.square(own[2]), _LEAST_SHARE * before_total + _TINY_M2)
    std = np.sqrt(np.where(is_smoothed, _nearer(smoothed, before, variance, total), total))
    if scale == ErrorScale():
        std = np.where(is_smoothed, samples.position_std_m, samples.filtered_std_m)
    return _Errors(
        walk, carried, told, variance, std, 2 * samples.dive + is_smoothed, known.carriage_std_m
    )


def _nearer(
    smoothed: FloatArray, before: FloatArray, after: FloatArray, most: FloatArray
) -> FloatArray:
    """Return smoothed variances after the scale made others of those that were worked out.

    What a dive's samples show of it may not explain how far smoothing went: of the same factor and
    the same difference the one that changes less is taken.
    """
    factor, difference = smoothed * (after / before), smoothed + after - before
    grown, shrunk = np.minimum(factor, difference), np.maximum(factor, difference)
    return np.minimum(np.where(after > before, grown, shrunk), np.maximum(most, _TINY_M2))


def _parts(
    known: Reckoning, walk: FloatArray, current2: FloatArray, walk2: float = 1.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return variance of the walk, way of the current, and what a fix at the end would tell.

    The walk's factor is not one of the fix with which it began.
    """
    current = np.sqrt(current2)
    carried = current * known.since_fix_s
    is_timed = np.isfinite(known.end_s)
    end_s = np.where(is_timed, known.end_s, 0.0)
    at_end = known.end_variance_m2 - known.fix_variance_m2
    at_end = np.maximum(at_end - np.square(known.current_std_m_s * end_s), 0.0)
    begun = np.minimum(walk, known.fix_variance_m2)
    walk = begun + walk2 * (walk - begun)
    at_end = begun + walk2 * np.maximum(at_end - begun, 0.0)
    jump = at_end + np.square(current * end_s) + known.fix_variance_m2
    is_ended = np.isfinite(jump) & (jump > 0.0)
    told = np.zeros(len(walk))
    np.divide(walk + carried * current * end_s, np.sqrt(jump), out=told, where=is_ended)
    return walk, carried, told
