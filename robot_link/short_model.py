"""A configuration as the small integers that travel, one for each field, and back.

A number is rounded to a short decimal (``robot_link.short_decimal``); a choice or a switch is its
number in the order of declaration. The fields of a group of settings stand where the group does.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeVar, get_args, get_origin

from pydantic import ValidationError

from autonomy.configuration import Configuration
from robot_link.short_decimal import code_of, value_of

Model = TypeVar("Model", bound=Configuration)

CODE_MAX = 2**24
"""Codes are smaller, so that a float32 holds each exactly."""
_THOUSANDTHS = 1e3


@dataclass(frozen=True, slots=True)
class _Field:
    """One number, choice or switch, by its way through the groups."""

    path: tuple[str, ...]
    choices: Sequence[Any]
    is_whole: bool

    @property
    def name(self) -> str:
        return ".".join(self.path)

    def code(self, value: Any, *, toward_zero: bool) -> int:  # noqa: ANN401 - a field's own type
        if self.choices:
            return self.choices.index(value)
        if self.is_whole:
            code = round(float(value) * _THOUSANDTHS)
            if abs(code) < CODE_MAX:
                return code
            raise ValueError(f"{self.name}: {value:g} cannot travel: it is more than 16,777")
        try:
            return code_of(float(value), toward_zero=toward_zero)
        except ValueError as error:
            raise ValueError(f"{self.name}: {error}") from error

    def value(self, code: int, owner: str) -> Any:  # noqa: ANN401 - a field's own type
        if not self.choices:
            return code / _THOUSANDTHS if self.is_whole else value_of(code)
        if not 0 <= code < len(self.choices):
            raise ValueError(f"{self.name} of {owner} is none of its choices")
        return self.choices[code]


def field_count(model: type[Configuration]) -> int:
    """Return how many codes say a configuration."""
    return sum(1 for _ in _fields(model, (), ()))


def codes_of(
    config: Configuration, what: str, *, in_thousandths: Collection[str] = ()
) -> tuple[int, ...]:
    """Return the codes of all fields, in the order of declaration, which say a valid model.

    A number that rounding would take out of its limits is rounded towards zero.

    Args:
        config: The configuration.
        what: What is said not to travel where it does not, such as "the gains".
        in_thousandths: Fields that travel as whole thousandths of their unit.

    Raises:
        ValueError: If a number does not fit, or the rounded model is none; the field is named.
    """
    fields = tuple(_fields(type(config), (), in_thousandths))
    problem = ""
    truncated: frozenset[tuple[str, ...]] = frozenset()
    everything = frozenset(field.path for field in fields)
    while True:
        codes = tuple(
            field.code(_read(config, field.path), toward_zero=field.path in truncated)
            for field in fields
        )
        try:
            model_of(type(config), codes, what, in_thousandths=in_thousandths)
        except ValidationError as error:
            problem = problem or sentence_of(error)
            if truncated == everything:
                raise ValueError(
                    f"{what} cannot travel, for rounded they would be none: {problem}"
                ) from error
            named = {tuple(map(str, one["loc"])) for one in error.errors()} & everything
            truncated = truncated | named if named - truncated else everything
        else:
            return codes


def model_of(
    model: type[Model], codes: Sequence[int], owner: str, *, in_thousandths: Collection[str] = ()
) -> Model:
    """Return the configuration that codes say.

    Args:
        model: What they say.
        codes: One for each field.
        owner: Whose fields they are said to be where one is impossible.
        in_thousandths: As of ``codes_of``.

    Raises:
        ValueError: If they say none; the field is named.
    """
    values: dict[str, Any] = {}
    for field, code in zip(_fields(model, (), in_thousandths), codes, strict=True):
        group = values
        for name in field.path[:-1]:
            group = group.setdefault(name, {})
        group[field.path[-1]] = field.value(code, owner)
    return model.model_validate(values)


def sentence_of(error: ValueError) -> str:
    """Return the first complaint of a model in one line, with the field's name."""
    if not isinstance(error, ValidationError):
        return str(error)
    first = error.errors()[0]
    place = ".".join(map(str, first["loc"]))
    said = str(first["msg"]).removeprefix("Value error, ")
    return f"{place}: {said}" if place else said


def _fields(
    model: type[Configuration], before: tuple[str, ...], in_thousandths: Collection[str]
) -> Iterator[_Field]:
    for name, field in model.model_fields.items():
        annotation: Any = field.annotation
        path = (*before, name)
        if isinstance(annotation, type) and issubclass(annotation, Configuration):
            yield from _fields(annotation, path, in_thousandths)
        else:
            yield _Field(path, _choices(annotation), name in in_thousandths)


def _read(config: Configuration, path: tuple[str, ...]) -> Any:  # noqa: ANN401 - a field's type
    value: Any = config
    for name in path:
        value = getattr(value, name)
    return value


def _choices(annotation: Any) -> Sequence[Any]:  # noqa: ANN401 - a field's annotation
    """Return what a field can be if it is a switch or a choice, in the order of their numbers."""
    if annotation is bool:
        return (False, True)
    return get_args(annotation) if get_origin(annotation) is Literal else ()
