"""Parent of every request body."""

from pydantic import BaseModel, ConfigDict


class Body(BaseModel):
    """A closed body: an unknown field is an error, so that a typo is not silently ignored."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
