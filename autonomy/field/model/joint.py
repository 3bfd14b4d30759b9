"""The joint auto-regressive model: the levels of a multi-fidelity field as one Gaussian process."""

from collections.abc import Sequence

import numpy as np

from autonomy.arrays import FloatArray
from autonomy.field.config import KernelParameters
from autonomy.field.model.gaussian_process import Ageing
from autonomy.field.model.model_prior import JointPrior, Places
from autonomy.field.model.posterior import Posterior, PosteriorAtPoints


class JointGaussianProcess(PosteriorAtPoints):
    """The field of the best level, given samples of every level.

    Unlike in the recursive model, well located samples take away uncertainty that the levels
    below left, because all levels are conditioned at once. ``JointPrior`` has the equations.
    """

    def __init__(
        self,
        levels: Sequence[KernelParameters],
        points: FloatArray,
        values: FloatArray,
        sample_levels: Sequence[int] | np.ndarray,
        *,
        rho: Sequence[float] = (),
        ageing: Ageing | None = None,
    ) -> None:
        """Condition on samples.

        Args:
            levels: Kernel and noise of each level, worst located first.
            points: Estimated positions of the samples, shape ``(n, 3)``, m.
            values: Measurements in the model's scale, less the prior mean, shape ``(n,)``.
            sample_levels: Level of each sample, shape ``(n,)``.
            rho: Factor by which the field of each level enters the one above; none for 1.
            ageing: Times, if the field changes.
        """
        still = JointPrior(tuple(levels), tuple(rho))
        prior = still if ageing is None else ageing.prior(still)
        places = Places.of(
            points,
            level=np.asarray(sample_levels, dtype=np.int64),
            time_s=0.0 if ageing is None else ageing.time_s,
        )
        super().__init__(
            Posterior(prior, places, values),
            still.top_level,
            0.0 if ageing is None else ageing.now_s,
        )
