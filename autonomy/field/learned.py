"""What learning the kernels of a field model leaves; free of compiled code."""

from autonomy.field.config import FieldConfig
from autonomy.result import Result


class LearnedKernels(Result):
    """By how much learned kernels are better."""

    is_changed: bool
    before_nll: float | None
    """Negative log likelihood of the samples before; none where there was nothing to compare."""
    after_nll: float | None
    """Negative log likelihood of the same samples after."""
    message: str
    """What was learned or why nothing was, for a person."""
    kernels: list[str]
    """A sentence for each kernel."""


class LearnedConfig(LearnedKernels):
    """Outcome of learning the kernels of a field model."""

    config: FieldConfig
    """The settings with the learned kernels and mean, or those given if nothing was better."""
