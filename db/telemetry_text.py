"""Telemetry as text, for where it waits outside of the database; a newer station reads it too."""

from collections.abc import Sequence
from typing import Any, get_args

from pydantic import ConfigDict, TypeAdapter, ValidationError

from db.ingest import Telemetry

_CONFIG = ConfigDict(ser_json_inf_nan="constants", ser_json_bytes="base64", val_json_bytes="base64")


def _adapter(kind: type) -> TypeAdapter[list[Any]]:
    return TypeAdapter(list[kind], config=_CONFIG)  # type: ignore[valid-type]


_ADAPTERS = {kind.__name__: _adapter(kind) for kind in get_args(Telemetry)}


class TelemetryTextError(ValueError):
    """The text holds something that this version of the station cannot read."""


def text_of(rows: Sequence[Telemetry]) -> bytes:
    """Return rows as lines: of each kind its name, and a JSON list of what was told, in order."""
    kinds: dict[str, list[Telemetry]] = {}
    for row in rows:
        kinds.setdefault(type(row).__name__, []).append(row)
    return b"\n".join(
        name.encode() + b" " + _ADAPTERS[name].dump_json(values) for name, values in kinds.items()
    )


def rows_of(text: bytes) -> list[Telemetry]:
    """Return the rows of a text, those of each kind in the order in which they were given.

    Raises:
        TelemetryTextError: If it cannot be read.
    """
    rows: list[Telemetry] = []
    for line in text.splitlines():
        name, _, values = line.partition(b" ")
        adapter = _ADAPTERS.get(name.decode(errors="replace"))
        if adapter is None:
            raise TelemetryTextError(f"nothing is known of {name!r}")
        try:
            rows += adapter.validate_json(values)
        except ValidationError as error:
            raise TelemetryTextError(str(error)) from error
    return rows
