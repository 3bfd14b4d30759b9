"""What a trajectory is worth: information gain and the ergodic measure, as the text has them."""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import block_diag, cho_factor, cho_solve, solve_triangular
from scipy.special import rel_entr

from autonomy.arrays import FloatArray
from autonomy.field.model.kernel import covariance
from autonomy.planner.belief import FieldBelief, SampleNoise, averaged_samples, sample_noise
from autonomy.planner.config import ErgodicConfig, PlannerConfig
from autonomy.planner.position_error import planned_noise
from autonomy.planner.resolution import FinePart

Objective = Callable[[FloatArray], float]
"""Takes the planned points of a trajectory, shape ``(m, 5)``; more is better."""

TINY_PROBABILITY = 1e-12
"""Keeps the logarithm of the ergodic measure finite where no sample reaches."""
TINY_DENSITY = 1e-30
"""Least sum of densities over the test points, for a trajectory that reaches none of them."""
PAST_SAMPLES_MAX = 1500
"""Past samples that an offered trajectory's gain is computed with; beyond, runs are averaged."""
_RELATIVE_JITTER = 1e-9
_NOISE_JITTER = 1e-3
_LEAST_REFERENCE = 1e-9


def jitter(belief: FieldBelief) -> float:
    """Return what is added to the test points' prior variance, for their determinant.

    A squared exponential field is so smooth that close test points have no determinant; it gets a
    thousandth of a sample's noise, less than which nobody could learn.
    """
    least = _RELATIVE_JITTER * belief.signal_variance
    if belief.shape != "squared_exponential":
        return least
    return max(least, _NOISE_JITTER * belief.noise_variance)


def objective(
    config: PlannerConfig, belief: FieldBelief, start_xy: tuple[float, float] = (0.0, 0.0)
) -> Objective:
    """Return the chosen objective as a function of planned points, computed the plain way.

    Args:
        config: Which objective, and its settings.
        belief: The field map so far.
        start_xy: North and east of where plans begin; the weighted sum compares with it.
    """
    if config.objective == "ergodic":
        return ErgodicMeasure(belief, config.ergodic)
    gain = InformationGain(belief, sample_noise(config, belief))
    if config.objective == "information_gain":
        return gain
    return weighted_sum(config, belief, start_xy, gain)


class InformationGain:
    r"""Entropy that a trajectory's samples take from the field at the test points, in nats.

    :math:`\frac12 (\log\det K_{prior} - \log\det K_{plan})` (thesis section 5.5.2), computed the
    plain way: both posterior covariances over the test points.
    """

    def __init__(self, belief: FieldBelief, noise: SampleNoise) -> None:
        """Condition on past and planned samples."""
        self._belief = belief
        self._noise = noise
        self._past, self._past_noise = belief.known_samples(noise)
        self._prior = self._log_determinant(self._past, np.diag(self._past_noise))

    def __call__(self, points: FloatArray) -> float:
        """Return the gain of planned points ``(m, 5)``."""
        noise = planned_noise(self._belief, self._noise, points)
        posterior = self._log_determinant(
            np.concatenate([self._past, points[:, 1:4]]),
            _blocks(np.diag(self._past_noise), noise),
        )
        return 0.5 * (self._prior - posterior)

    def _log_determinant(self, samples: FloatArray, noise: FloatArray) -> float:
        belief, kernel = self._belief, self._belief.kernel()
        posterior = covariance(belief.test_points, belief.test_points, kernel)  # (q, q)
        posterior[np.diag_indices_from(posterior)] += jitter(belief)
        if len(samples):
            cross = covariance(samples, belief.test_points, kernel)  # (n, q)
            gram = covariance(samples, samples, kernel) + noise  # (n, n)
            posterior -= cross.T @ cho_solve(cho_factor(gram, lower=True), cross)
        return float(np.linalg.slogdet(posterior).logabsdet)


def _blocks(*blocks: FloatArray) -> FloatArray:
    """Return the block diagonal matrix of some."""
    return np.asarray(block_diag(*blocks), dtype=np.float64)


def samples_covariance(belief: FieldBelief, samples: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the covariance of samples with noise.

    Args:
        belief: The kernel.
        samples: Where, shape ``(n, 3)``.
        noise: Noise variance of each, shape ``(n,)``.

    Returns:
        Shape ``(n, n)``.
    """
    gram = covariance(samples, samples, belief.kernel())
    gram[np.diag_indices_from(gram)] += noise
    return gram


class FieldInformation:
    r"""What a search maximizes, which knows no test points: the reference of its compiled form.

    :math:`\frac12 [\log\det(C_{pp|D} + N) - \log\det(N + R)]`, where p are the planned points with
    noise N, D the past samples, and R is the covariance of what of the field lies between test
    points (``resolution.FinePart``), between points of one edge. It is about the information gain
    at any test points that are spread evenly.
    """

    def __init__(self, belief: FieldBelief, noise: SampleNoise, fine: FinePart) -> None:
        """Condition on the past samples."""
        self._belief = belief
        self._noise = noise
        self._fine = fine
        self._past, past_noise = belief.known_samples(noise)
        self._factor = np.linalg.cholesky(samples_covariance(belief, self._past, past_noise))

    def __call__(self, edges: Sequence[FloatArray]) -> float:
        """Return the information of the planned points ``(m, 5)`` of each edge."""
        belief, kernel = self._belief, self._belief.kernel()
        planned = np.concatenate(edges)[:, 1:4]
        noise = [planned_noise(belief, self._noise, points) for points in edges]
        given = covariance(planned, planned, kernel) + _blocks(*noise)  # (m, m)
        if len(self._past):
            cross = covariance(self._past, planned, kernel)
            white = solve_triangular(self._factor, cross, lower=True)  # (n, m)
            given -= white.T @ white
        alone = 0.0
        for points, own in zip(edges, noise, strict=True):
            near = points[:, 1:4] * self._fine.nearness
            fine = covariance(near, near, kernel) * (self._fine.variance / belief.signal_variance)
            alone += float(np.linalg.slogdet(own + fine).logabsdet)
        return 0.5 * (float(np.linalg.slogdet(given).logabsdet) - alone)


class MutualInformation:
    r"""The same gain by the symmetry of mutual information; far fewer operations.

    :math:`\frac12 [\log\det(C_{pp|D} + N) - \log\det(C_{pp|D,f^*} + N)]`, where p are the planned
    points, D the past samples and f* the field at the test points.
    """

    def __init__(
        self,
        belief: FieldBelief,
        noise: SampleNoise,
        past_samples_max: int = PAST_SAMPLES_MAX,
    ) -> None:
        """Condition on the past samples, averaged until no more than some number remain.

        Args:
            belief: The field map so far.
            noise: Which noise a sample counts with.
            past_samples_max: Time grows with the cube of this, memory with its square.
        """
        self._belief = belief
        self._noise = noise
        samples, past_noise = averaged_samples(*belief.known_samples(noise), past_samples_max)
        self._past = len(samples)
        self._known = np.concatenate([samples, belief.test_points])  # (n + q, 3)
        added = np.full(len(belief.test_points), jitter(belief))
        known = samples_covariance(belief, self._known, np.concatenate([past_noise, added]))
        self._factor = np.linalg.cholesky(known)

    def __call__(self, points: FloatArray) -> float:
        """Return the gain of planned points ``(m, 5)``."""
        belief, kernel = self._belief, self._belief.kernel()
        planned = points[:, 1:4]
        white = solve_triangular(
            self._factor, covariance(self._known, planned, kernel), lower=True
        )  # (n + q, m)
        prior = covariance(planned, planned, kernel)
        prior += planned_noise(belief, self._noise, points)
        past, test = white[: self._past], white[self._past :]
        given_past = prior - past.T @ past  # (m, m)
        given_both = given_past - test.T @ test  # (m, m)
        return 0.5 * float(
            np.linalg.slogdet(given_past).logabsdet - np.linalg.slogdet(given_both).logabsdet
        )

    def left_to_gain(self) -> float:
        """Return what one exact sample at every test point would bring, nats."""
        white = self._factor[self._past :, self._past :]  # (q, q), factor of C_**|D
        noise = self._belief.noise_variance
        information = np.eye(len(white)) + white.T @ white / noise
        return 0.5 * float(np.linalg.slogdet(information).logabsdet)


class WeightedSum:
    r"""Both objectives, each as a share of what is left, added up with a weight.

    :math:`w \, I / I_{left} + (1 - w) (1 - E / E_{start})`: I is the information gain of the
    trajectory and :math:`I_{left}` that of one exact sample at every test point; E is its ergodic
    measure and :math:`E_{start}` that of a robot that stays where it is. Either term is 0 for a
    trajectory that does nothing and 1 for one that leaves nothing to do.
    """

    def __init__(
        self,
        weight: float,
        gain: tuple[Objective, float],
        ergodic: tuple[Objective, float],
    ) -> None:
        """Take each objective together with what it is compared with.

        Args:
            weight: That of information gain, 0..1.
            gain: Information gain, and what is left to gain, nats.
            ergodic: The ergodic measure, and that of staying at the start.
        """
        self._gain, left = gain
        self._ergodic, stay = ergodic
        self.gain_weight = weight / max(left, _LEAST_REFERENCE)
        self.measure_weight = (1.0 - weight) / max(-stay, _LEAST_REFERENCE)
        self.constant = 1.0 - weight

    def __call__(self, points: FloatArray) -> float:
        """Return the sum for planned points ``(m, 5)``."""
        gained = self.gain_weight * self._gain(points)
        return gained + self.measure_weight * self._ergodic(points) + self.constant


def weighted_sum(
    config: PlannerConfig,
    belief: FieldBelief,
    start_xy: tuple[float, float],
    gain: Objective | None = None,
) -> WeightedSum:
    """Return the weighted sum of both objectives for plans that begin at a place.

    Args:
        config: Weight and settings of either objective.
        belief: The field map so far.
        start_xy: North and east of where plans begin, m.
        gain: Information gain; by default in its fast form.
    """
    symmetric = MutualInformation(belief, sample_noise(config, belief))
    ergodic = ErgodicMeasure(belief, config.ergodic)
    stay = np.array([[0.0, *start_xy, 0.0, 0.0]])
    return WeightedSum(
        config.information_weight,
        (symmetric if gain is None else gain, symmetric.left_to_gain()),
        (ergodic, ergodic(stay)),
    )


class ErgodicMeasure:
    r"""Negative divergence of where a trajectory spends its time from where it should.

    :math:`-D_{KL}(p, q)` over the test points (thesis section 5.5.2 and Appendix D): p is the
    softmax of a weighted sum of the map's mean and standard deviation, q the normalized mean of a
    Gaussian around each planned point.
    """

    def __init__(self, belief: FieldBelief, config: ErgodicConfig) -> None:
        self._belief = belief
        self._reach = np.array([config.reach_north_m, config.reach_east_m, config.reach_depth_m])
        self.target = target_distribution(belief, config.exploitation)

    def __call__(self, points: FloatArray) -> float:
        """Return the measure of planned points ``(m, 5)``."""
        offset = points[:, None, 1:4] - self._belief.test_points[None, :, :]  # (m, q, 3)
        density = np.exp(-0.5 * np.square(offset / self._reach).sum(axis=2)).mean(axis=0)  # (q,)
        visited = density / max(density.sum(), TINY_DENSITY) + TINY_PROBABILITY
        return -float(rel_entr(self.target, visited).sum())


def target_distribution(belief: FieldBelief, exploitation: float) -> FloatArray:
    """Return the softmax of ``alpha mean + (1 - alpha) std`` over the test points, ``(q,)``."""
    score = exploitation * belief.mean + (1.0 - exploitation) * belief.std
    weight = np.exp(score - score.max())
    return weight / weight.sum()
