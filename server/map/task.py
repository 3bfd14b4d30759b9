"""What the tasks about maps are given and leave, and their names.

Like ``problem``, this loads no numba: the station imports it, the tasks' own modules do the work.
"""

from dataclasses import dataclass
from typing import Final, Literal

from autonomy.arrays import FloatArray
from autonomy.field.config import FieldConfig, FieldModelKey
from autonomy.field.samples import FieldSamples
from autonomy.field.score import Scores
from autonomy.site import Box, Site

COMPARE_MAPS: Final = "server.map.comparison_task:run"
"""Takes a ``ComparisonProblem``, reports share and message, leaves ``Compared``."""
LEARN_FIELD: Final = "server.map.learning_task:run"
"""Takes a ``LearningProblem``, reports share and message, leaves a ``LearnedConfig``."""

Against = Literal["truth", "held-out samples", "held-out samples, placed by cameras"]
"""What the models of a comparison are scored against."""
PLACED_BY_CAMERAS: Final = "held-out samples, placed by cameras"


@dataclass(frozen=True, slots=True)
class ComparisonProblem:
    """Samples on which all field models are compared."""

    field: FieldConfig
    """Settings; its model does not count."""
    domain: Box
    site: Site
    samples: FieldSamples
    is_simulated: bool
    """Whether the truth is known, where there is one of the variable."""
    with_maps: bool = True
    """Whether the maps themselves are wanted, or their scores alone."""
    places_seen: FloatArray | None = None
    """Where cameras saw the robots at their samples, shape ``(n, 3)``, m; not numbers where they
    did not; ``None`` without cameras."""


@dataclass(frozen=True, slots=True, eq=False)
class ComparedModel:
    """One model conditioned on all samples."""

    model: FieldModelKey
    scores: Scores | None
    """``None`` where there is nothing to score against."""
    log_marginal_likelihood: float
    mean: FloatArray | None
    """On the grid of the map, shape ``(q,)``; ``None`` if the maps were not wanted."""
    std: FloatArray | None


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """All field models on the same samples."""

    models: tuple[ComparedModel, ...]
    """Fewer than there are if the work was cancelled."""
    against: Against | None
    message: str
    """What to know of the scores, one sentence or "" """
    samples_per_level: tuple[int, ...]
    """Samples that the models were given, by fidelity level."""


@dataclass(frozen=True, slots=True)
class LearningProblem:
    """A field model whose kernels are to be learned."""

    field: FieldConfig
    samples: FieldSamples
    seed: int
