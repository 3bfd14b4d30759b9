"""Gaussian process regression as in a textbook: the readable reference of the live map."""

from dataclasses import dataclass

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.model.model_prior import AgeingPrior, Places, Prior, SinglePrior
from autonomy.field.model.posterior import Posterior, PosteriorAtPoints


@dataclass(frozen=True, slots=True, eq=False)
class Ageing:
    """When samples were taken of a field that changes, and when it is looked at."""

    time_s: FloatArray
    """Time of each sample, shape ``(n,)``."""
    now_s: float
    """Time of the map."""
    memory_s: float
    """Time constant by which covariances fade; 0 for a field that stays."""

    def prior(self, still: Prior) -> Prior:
        """Return a prior whose field changes."""
        return AgeingPrior(still, self.memory_s) if self.memory_s > 0.0 else still


class GaussianProcess(PosteriorAtPoints):
    """A zero-mean Gaussian process conditioned on noisy samples at exactly known points."""

    def __init__(
        self,
        parameters: KernelParameters,
        points: FloatArray,
        values: FloatArray,
        *,
        noise: FloatArray | None = None,
        ageing: Ageing | None = None,
    ) -> None:
        """Condition on samples.

        Args:
            parameters: Kernel, and the noise of a measurement.
            points: Where the samples were taken, shape ``(n, 3)``, m.
            values: Measurements less the prior mean, shape ``(n,)``.
            noise: Noise variances ``(n,)`` or covariances ``(n, n)`` where they are not the
                kernel's.
            ageing: Times, if the field changes.
        """
        still = SinglePrior(parameters)
        prior = still if ageing is None else ageing.prior(still)
        places = Places.of(points, time_s=0.0 if ageing is None else ageing.time_s)
        super().__init__(
            Posterior(prior, places, values, noise), 0, 0.0 if ageing is None else ageing.now_s
        )
