"""Values as contents that name themselves: JSON that holds its arrays by their SHA-256.

Arrays are cut into parts of equal many rows. Samples are appended, so that of two maps of one water
nearly all parts are the same, and are kept once.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import GenericAlias
from typing import Any, Final, TypeVar, cast

import numpy as np
import numpy.typing as npt
from pydantic import ConfigDict, TypeAdapter, ValidationError

T = TypeVar("T")
_ROWS: Final = 4096
_ARRAY: Final = "array of"
"""Key of an object that stands for an array."""


class ContentError(Exception):
    """A content is missing, is not what its name says, or does not fit; the sentence says which."""


@dataclass(frozen=True, slots=True)
class Packed:
    """A value as contents."""

    sha256: str
    """Name of the whole: that of its JSON, which names its parts."""
    contents: Mapping[str, bytes]
    """By their SHA-256."""
    tree: Any
    """The JSON."""


def packed(value: object, kind: type[object]) -> Packed:
    """Return a value of dataclasses, models and arrays as contents; equal values are equal bytes.

    Args:
        value: The value.
        kind: Its type.
    """
    contents: dict[str, bytes] = {}

    def keep(other: object) -> object:
        if isinstance(other, np.generic):
            return other.item()
        if isinstance(other, np.ndarray):
            return _kept(cast("npt.NDArray[Any]", other), contents)
        raise TypeError(f"a decision cannot keep a {type(other).__name__}")

    (tree,) = _adapter(kind).dump_python((value,), mode="json", fallback=keep, warnings=False)
    return _named(tree, contents)


def packed_json(tree: Any) -> Packed:  # noqa: ANN401 - any JSON
    """Return plain JSON as a content."""
    return _named(tree, {})


def unpacked(kind: type[T], sha256: str, find: Callable[[str], bytes | None]) -> T:
    """Return the value of a content.

    Args:
        kind: Its type.
        sha256: Its name.
        find: Returns a content, ``None`` where it is missing or not what its name says.

    Raises:
        ContentError: If one is, or the value is none of the type.
    """
    tree = json_of(sha256, find)
    try:
        return _adapter(kind).validate_python((_with_arrays(tree, find),))[0]
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"][1:]))
        raise ContentError(
            f"{place} of what it was made of does not fit: {first['msg']}"
        ) from error


def json_of(sha256: str, find: Callable[[str], bytes | None]) -> Any:  # noqa: ANN401 - any JSON
    """Return the JSON of a content.

    Raises:
        ContentError: If it is missing, or not what its name says.
    """
    return json.loads(_found(sha256, find))


def digest(tree: Any) -> str:  # noqa: ANN401 - any JSON
    """Return the SHA-256 of JSON."""
    return hashlib.sha256(_text(tree)).hexdigest()


def quantized(value: object) -> object:
    """Return a value as JSON with numbers of nine digits, and arrays by the hash of their floats.

    What two runs of the same work differ by, if at all, are the last of sixteen digits; the station
    itself keeps arrays in single precision.
    """
    if isinstance(value, np.generic):
        return quantized(value.item())
    if isinstance(value, float):
        return float(f"{value:.9g}") if math.isfinite(value) else str(value)
    if isinstance(value, np.ndarray):
        array = cast("npt.NDArray[Any]", value)
        rounded = np.ascontiguousarray(array, "<f4")
        return {_ARRAY: list(array.shape), "sha256": hashlib.sha256(rounded.tobytes()).hexdigest()}
    if isinstance(value, Mapping):
        items = cast("Mapping[str, object]", value).items()
        return {str(key): quantized(one) for key, one in items}
    if isinstance(value, list | tuple):
        return [quantized(one) for one in cast("list[object]", value)]
    return value


@cache
def _adapter(kind: type[Any]) -> TypeAdapter[tuple[Any]]:
    # In a tuple, since the configuration of a bare dataclass is its own alone.
    alone: Any = GenericAlias(tuple, (kind,))
    return TypeAdapter(alone, config=ConfigDict(arbitrary_types_allowed=True))


def _text(tree: Any) -> bytes:  # noqa: ANN401 - any JSON
    return json.dumps(tree, sort_keys=True, separators=(",", ":")).encode()


def _named(tree: Any, contents: dict[str, bytes]) -> Packed:  # noqa: ANN401 - any JSON
    text = _text(tree)
    sha256 = hashlib.sha256(text).hexdigest()
    return Packed(sha256, contents | {sha256: text}, tree)


def _kept(array: npt.NDArray[Any], contents: dict[str, bytes]) -> dict[str, Any]:
    whole = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
    parts: list[str] = []
    for first in range(0, len(whole), _ROWS) if whole.ndim else (0,):
        part = whole[first : first + _ROWS].tobytes() if whole.ndim else whole.tobytes()
        parts.append(hashlib.sha256(part).hexdigest())
        contents[parts[-1]] = part
    return {_ARRAY: whole.dtype.str, "shape": list(array.shape), "parts": parts}


def _with_arrays(tree: Any, find: Callable[[str], bytes | None]) -> Any:  # noqa: ANN401 - any JSON
    if isinstance(tree, list):
        return [_with_arrays(one, find) for one in cast("list[Any]", tree)]
    if not isinstance(tree, dict):
        return tree
    document = cast("dict[str, Any]", tree)
    if _ARRAY not in document:
        return {key: _with_arrays(one, find) for key, one in document.items()}
    content = b"".join(_found(part, find) for part in document["parts"])
    array = np.frombuffer(content, np.dtype(document[_ARRAY])).reshape(document["shape"])
    return array.astype(array.dtype.newbyteorder("="))


def _found(sha256: str, find: Callable[[str], bytes | None]) -> bytes:
    content = find(sha256)
    if content is None:
        raise ContentError("what it was made of is not kept whole")
    return content
