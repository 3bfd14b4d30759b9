"""What a trajectory is worth: information gain and the ergodic measure, as the text has them."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular
from scipy.special import rel_entr

from autonomy.arrays import FloatArray
from autonomy.field.kernel import matern32
from autonomy.planner.belief import FieldBelief, averaged_samples
from autonomy.planner.config import ErgodicConfig, PlannerConfig

Objective = Callable[[FloatArray], float]
"""Takes the planned points of a trajectory, shape ``(m, 5)``; more is better."""

TINY_PROBABILITY = 1e-12
"""Keeps the logarithm of the ergodic measure finite where no sample reaches."""
TINY_DENSITY = 1e-30
"""Least sum of densities over the test points, for a trajectory that reaches none of them."""
PAST_SAMPLES_MAX = 1500
"""Past samples that an offered trajectory's gain is computed with; beyond, runs are averaged."""
RELATIVE_JITTER = 1e-9
"""Part of the signal variance added to the test points' prior variance, for their determinant."""


def objective(config: PlannerConfig, belief: FieldBelief) -> Objective:
    """Return the chosen objective as a function of planned points."""
    if config.objective == "ergodic":
        return ErgodicMeasure(belief, config.ergodic)
    return InformationGain(belief, config.counted_thresholds_m())


class InformationGain:
    r"""Entropy that a trajectory's samples take from the field at the test points, in nats.

    :math:`\frac12 (\log\det K_{prior} - \log\det K_{plan})` (thesis section 5.5.2), computed the
    plain way: both posterior covariances over the test points.
    """

    def __init__(self, belief: FieldBelief, thresholds_m: tuple[float, ...] = ()) -> None:
        """Condition on the past samples; thresholds are those of ``FieldBelief.noise``."""
        self._belief = belief
        self._thresholds = thresholds_m
        self._past_noise = belief.sample_noise(thresholds_m)
        self._prior = self._log_determinant(belief.sample_points, self._past_noise)

    def __call__(self, points: FloatArray) -> float:
        """Return the gain of planned points ``(m, 5)``."""
        noise = self._belief.noise(points[:, 4], self._thresholds)
        posterior = self._log_determinant(
            np.concatenate([self._belief.sample_points, points[:, 1:4]]),
            np.concatenate([self._past_noise, noise]),
        )
        return 0.5 * (self._prior - posterior)

    def _log_determinant(self, samples: FloatArray, noise: FloatArray) -> float:
        belief, kernel = self._belief, self._belief.kernel()
        covariance = matern32(belief.test_points, belief.test_points, kernel)  # (q, q)
        covariance[np.diag_indices_from(covariance)] += RELATIVE_JITTER * belief.signal_variance
        if len(samples):
            cross = matern32(samples, belief.test_points, kernel)  # (n, q)
            gram = matern32(samples, samples, kernel) + np.diag(noise)  # (n, n)
            covariance -= cross.T @ cho_solve(cho_factor(gram, lower=True), cross)
        return float(np.linalg.slogdet(covariance).logabsdet)


def known_covariance(belief: FieldBelief, samples: FloatArray, noise: FloatArray) -> FloatArray:
    """Return the covariance of samples with noise, then of test points.

    Args:
        belief: Kernel and test points.
        samples: Past samples, shape ``(n, 3)``.
        noise: Noise variance of each, shape ``(n,)``.

    Returns:
        Shape ``(n + q, n + q)``.
    """
    known = np.concatenate([samples, belief.test_points])  # (n + q, 3)
    gram = matern32(known, known, belief.kernel())
    jitter = np.full(len(belief.test_points), RELATIVE_JITTER * belief.signal_variance)
    gram[np.diag_indices_from(gram)] += np.concatenate([noise, jitter])
    return gram


class MutualInformation:
    r"""The same gain by the symmetry of mutual information; far fewer operations.

    :math:`\frac12 [\log\det(C_{pp|D} + N) - \log\det(C_{pp|D,f^*} + N)]`, where p are the planned
    points, D the past samples and f* the field at the test points.
    """

    def __init__(
        self,
        belief: FieldBelief,
        thresholds_m: tuple[float, ...] = (),
        past_samples_max: int = PAST_SAMPLES_MAX,
    ) -> None:
        """Condition on the past samples, averaged until no more than some number remain.

        Args:
            belief: The field map so far.
            thresholds_m: Boundaries of the fidelity levels (``FieldBelief.noise``).
            past_samples_max: Time grows with the cube of this, memory with its square.
        """
        self._belief = belief
        self._thresholds = thresholds_m
        samples, noise = averaged_samples(
            belief.sample_points, belief.sample_noise(thresholds_m), past_samples_max
        )
        self._past = len(samples)
        self._known = np.concatenate([samples, belief.test_points])  # (n + q, 3)
        self._factor = np.linalg.cholesky(known_covariance(belief, samples, noise))

    def __call__(self, points: FloatArray) -> float:
        """Return the gain of planned points ``(m, 5)``."""
        belief, kernel = self._belief, self._belief.kernel()
        planned = points[:, 1:4]
        white = solve_triangular(
            self._factor, matern32(self._known, planned, kernel), lower=True
        )  # (n + q, m)
        prior = matern32(planned, planned, kernel)
        prior += np.diag(belief.noise(points[:, 4], self._thresholds))
        past, test = white[: self._past], white[self._past :]
        given_past = prior - past.T @ past  # (m, m)
        given_both = given_past - test.T @ test  # (m, m)
        return 0.5 * float(
            np.linalg.slogdet(given_past).logabsdet - np.linalg.slogdet(given_both).logabsdet
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
