"""What a study leaves: declared once, kept as its JSON, and shown by REST as it is."""

import math
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, ConfigDict

from autonomy.described import Described


class Result(Described, BaseModel):
    """Base of every result: never changed, and described to REST by its docstrings.

    It reads what an older version kept: fields that it does not know are passed over.
    """

    model_config = ConfigDict(frozen=True, json_schema_serialization_defaults_required=True)


def known(value: float | None) -> float | None:
    """Return a number, or None if it is not finite."""
    return value if value is not None and math.isfinite(value) else None


Known = Annotated[float | None, BeforeValidator(known)]
"""A number that may be missing; what is not finite is missing."""
