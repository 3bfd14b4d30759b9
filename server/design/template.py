"""A template with its parameters said: the document that a design begins with."""

import copy
import math
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from autonomy.design.document import Design
from server.base.problem import FieldError, below, invalid, unprocessable
from server.design.view import TemplateParameter


def check_parameters(document: Design, parameters: Sequence[TemplateParameter]) -> None:
    """Refuse parameters that a document does not have.

    Raises:
        Problem: 422 with the path of each that is wrong.
    """
    errors: list[FieldError] = []
    keys = [one.key for one in parameters]
    values = document.model_dump(mode="json")
    for number, one in enumerate(parameters):
        if keys.index(one.key) != number:
            text = f"there are two parameters {one.key!r}"
            errors.append(FieldError(loc=["parameters", number, "key"], msg=text))
        if one.low is not None and one.high is not None and one.low > one.high:
            text = f"it must not exceed {one.high:g}"
            errors.append(FieldError(loc=["parameters", number, "low"], msg=text))
        if one.default is not None and (fault := _fault(one, one.default)):
            errors.append(FieldError(loc=["parameters", number, "default"], msg=fault))
        for place, path in enumerate(one.paths):
            if not _holds_number(values, path):
                loc: list[str | int] = ["parameters", number, "paths", place]
                errors.append(FieldError(loc=loc, msg=f"the document has no number at {path!r}"))
    if errors:
        raise unprocessable(f"{len(errors)} fields are wrong.", errors)


def filled(
    document: Mapping[str, Any],
    parameters: Sequence[TemplateParameter],
    values: Mapping[str, float],
) -> Design:
    """Return a template's document with its parameters said.

    Raises:
        Problem: 422 that names each parameter that is missing, unknown or beyond its limits, or
            what the document then breaks.
    """
    errors: list[FieldError] = []
    known = {one.key for one in parameters}
    errors += [
        FieldError(loc=["values", key], msg=f"the template has no parameter {key!r}")
        for key in values
        if key not in known
    ]
    wanted = copy.deepcopy(dict(document))
    for one in parameters:
        value = values.get(one.key, one.default)
        fault = _fault(one, value)
        if fault or value is None:
            errors.append(FieldError(loc=["values", one.key], msg=fault))
            continue
        for path in one.paths:
            _put(wanted, path, value)
    if errors:
        raise unprocessable(f"{len(errors)} values are missing or wrong.", errors)
    try:
        return Design.model_validate(wanted)
    except ValidationError as error:
        raise below(invalid(error, Design), "document") from error


def _fault(one: TemplateParameter, value: float | None) -> str:
    unit = f" {one.unit}" if one.unit else ""
    if value is None:
        return f"{one.title} must be said"
    if not math.isfinite(value):
        return f"{one.title} must be a number"
    if one.low is not None and value < one.low:
        return f"{one.title} must be at least {one.low:g}{unit}, not {value:g}"
    if one.high is not None and value > one.high:
        return f"{one.title} must be at most {one.high:g}{unit}, not {value:g}"
    return ""


def _steps(path: str) -> list[str]:
    return [part.replace("~1", "/").replace("~0", "~") for part in path.split("/")[1:]]


def _inner(value: Any, step: str) -> Any:  # noqa: ANN401 - JSON
    if isinstance(value, list):
        return value[int(step)]
    return value[step]


def _holds_number(document: Any, path: str) -> bool:  # noqa: ANN401 - JSON
    try:
        for step in _steps(path):
            document = _inner(document, step)
    except (KeyError, IndexError, ValueError, TypeError):
        return False
    is_number = isinstance(document, int | float) and not isinstance(document, bool)
    return path.startswith("/") and (is_number or document is None)


def _put(document: Any, path: str, value: float) -> None:  # noqa: ANN401 - JSON
    *way, last = _steps(path)
    for step in way:
        document = _inner(document, step)
    if isinstance(document, list):
        document[int(last)] = value
    else:
        document[last] = value
