"""The field models that operators can compare, each named once."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, get_args

from autonomy.field.config import FieldModelKey

MODEL_TITLES: Final[Mapping[str, str]] = MappingProxyType(
    {
        "single": "Single, positions taken for exact",
        "recursive": "Recursive, by position uncertainty",
        "joint": "Joint auto-regressive",
        "position_noise": "Position-dependent noise",
    }
)
"""What operators read, by key."""
MODELS: Final[tuple[FieldModelKey, ...]] = get_args(FieldModelKey)
"""Every model, in the order in which they are listed."""
