"""Reads and converts an upload in a worker process, where a broken file takes no station down."""

import shutil
from collections.abc import Callable
from collections.abc import Mapping as AnyMapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from autonomy.channel import ChannelCatalogue
from server.recording_file.card import Card
from server.recording_file.conversion import Converted, convert
from server.recording_file.mapping import (
    FLIGHT,
    SHOWN_ROWS,
    Mapping,
    MappingError,
    faults_of,
    proposed,
    says_zone,
    time_format_of,
)
from server.recording_file.raw import RawRecording, UnreadableError
from server.recording_file.reading import read_files

PROPOSE = f"{__name__}:propose"
CONVERT = f"{__name__}:convert_upload"
CARD = "card"
"""The format of a card, which needs no mapping."""
_UNPACKED = "unpacked"
_READ_SHARE = 0.8


class ReadingStoppedError(Exception):
    """Whoever asked for the reading wants it no more."""


@dataclass(frozen=True, slots=True)
class Template:
    """A mapping that was kept."""

    mapping: Mapping
    at: str
    """When; tells it from others of its name."""


@dataclass(frozen=True, slots=True)
class ReadOrder:
    """Files that are to be read."""

    folder: Path
    """Of the upload; each file lies in it under its number."""
    names: tuple[str, ...]
    """As the operator knows them."""
    channels: ChannelCatalogue
    templates: AnyMapping[str, Template]
    """Mappings that were kept, by name."""
    mapping: Mapping | None = None
    """What was confirmed."""


def propose(
    order: ReadOrder, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Read files and return what is proposed for them, as JSON, or ``refused`` alone."""
    try:
        raw = _read(order, report, is_cancelled)
    except UnreadableError as error:
        return {"refused": str(error)}
    if isinstance(raw, Card):
        return _proposed_card(raw)
    mapping, template = _proposed(raw, order)
    roles = {one.name: one for one in mapping.columns}
    wrong = faults_of(raw, mapping, order.channels).faults
    return {
        "format": raw.format,
        "files": list(raw.files),
        "rows": len(raw) + len(raw.faults),
        "faults": len(raw.faults),
        "mapping": mapping.model_dump(mode="json"),
        "columns": [
            {
                "name": column.name,
                "is_text": column.texts is not None,
                "role": roles[column.name].role,
                "target": roles[column.name].target,
                "unit": roles[column.name].unit,
                "time_format": time_format_of(column),
                "has_zone": says_zone(column),
                "cells": [column.shown(row) for row in range(min(SHOWN_ROWS, len(raw)))],
            }
            for column in raw.columns.values()
        ],
        "missing": [{"place": place, "reason": reason} for place, reason in wrong],
        "notes": list(raw.notes),
        "flight": list(FLIGHT),
        "template": template,
        "template_at": order.templates[template].at if template else "",
        "is_simulated": raw.is_simulated,
    }


def convert_upload(
    order: ReadOrder, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> Converted | Card | list[tuple[str, str]] | str:
    """Read files again and follow a mapping; return why not, or what is wrong with the mapping.

    A card needs no mapping.
    """
    try:
        raw = _read(order, report, is_cancelled)
        if isinstance(raw, Card):
            return raw
        return convert(raw, order.mapping or proposed(raw, order.channels), order.channels)
    except MappingError as error:
        return error.faults
    except UnreadableError as error:
        return str(error)


def _read(
    order: ReadOrder, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> RawRecording | Card:
    unpacked = order.folder / _UNPACKED
    shutil.rmtree(unpacked, ignore_errors=True)

    def tell(share: float) -> None:
        if is_cancelled():
            raise ReadingStoppedError
        report((share * _READ_SHARE, "Reading the files"))

    try:
        unpacked.mkdir(parents=True)
        files = [(name, order.folder / str(place)) for place, name in enumerate(order.names)]
        return read_files(files, unpacked, tell)
    except OSError as error:
        raise UnreadableError(f"The files cannot be read: {error.strerror}.") from error
    finally:
        shutil.rmtree(unpacked, ignore_errors=True)


def _proposed_card(card: Card) -> dict[str, Any]:
    logs = len({one.key.log for one in card.entries})
    times = card.times
    notes = [
        f"The card of a robot of ours: {len(card.entries):,} measurements of {logs:,} logs and "
        f"{len(card.states):,} states, {min(times):%Y-%m-%d %H:%M} to "
        f"{max(times):%Y-%m-%d %H:%M}Z by its clock."
    ]
    if card.left_out:
        notes.append(f"Not read: {', '.join(card.left_out)}.")
    return {
        "format": CARD,
        "files": list(card.files),
        "rows": card.read,
        "faults": len(card.faults),
        "mapping": Mapping(columns=()).model_dump(mode="json"),
        "columns": [],
        "missing": [],
        "notes": notes,
        "flight": [],
        "template": "",
        "template_at": "",
        "is_simulated": False,
    }


def _proposed(raw: RawRecording, order: ReadOrder) -> tuple[Mapping, str]:
    """Return the kept mapping that fits most columns, else a guess, and the name of the former."""
    guess = proposed(raw, order.channels)
    names = [one.name for one in guess.columns]
    fitting = [
        (len(told), name, kept.mapping)
        for name, kept in order.templates.items()
        for told in [{one.name for one in kept.mapping.columns if one.role != "ignore"}]
        if told <= set(names)
    ]
    if not fitting:
        return guess, ""
    _, name, mapping = max(fitting, key=lambda one: one[:2])
    kept = {one.name: one for one in mapping.columns}
    columns = tuple(
        kept.get(one.name, one.model_copy(update={"role": "ignore", "target": ""}))
        for one in guess.columns
    )
    return mapping.model_copy(update={"columns": columns}), name
