"""Parent of every view."""

from pydantic import ConfigDict


class View:
    """Lets the docstring below a field become its description in the OpenAPI schema."""

    __slots__ = ()
    __pydantic_config__ = ConfigDict(use_attribute_docstrings=True)
