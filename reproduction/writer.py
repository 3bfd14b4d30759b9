"""Writes a reproduction as JSON, CSV and PNG."""

import csv
import io
import json
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

from reproduction.drawing import png
from reproduction.result import Reproduction

COLUMNS = ("row", "column", "ours", "thesis", "unit")


def document(result: Reproduction) -> dict[str, Any]:
    """Return what the JSON file holds: everything but the figure."""
    return {
        "name": result.name,
        "title": result.title,
        "scenario": dict(result.scenario),
        "rows": [asdict(row) for row in result.rows],
        "notes": list(result.notes),
    }


def write(result: Reproduction, folder: Path) -> tuple[Path, ...]:
    """Write ``<name>.json``, ``<name>.csv`` and ``<name>.png``; each is whole or not there.

    Args:
        result: What to write.
        folder: Where to; created if missing.

    Returns:
        The files.

    Raises:
        OSError: If the folder cannot be written.
        ValueError: If a number is not finite.
    """
    contents = {
        "json": json.dumps(document(result), indent=1, allow_nan=False, ensure_ascii=False) + "\n",
        "csv": _csv(result),
        "png": png(result),
    }
    folder.mkdir(parents=True, exist_ok=True)
    return tuple(
        _replace(folder / f"{result.name}.{ending}", content)
        for ending, content in contents.items()
    )


def _csv(result: Reproduction) -> str:
    text = io.StringIO(newline="")
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(COLUMNS)
    for row in result.rows:
        lines.writerow("" if value is None else value for value in asdict(row).values())
    return text.getvalue()


def _replace(target: Path, content: str | bytes) -> Path:
    """Put the content in place in one step, so that no reader sees half of it."""
    data = content.encode() if isinstance(content, str) else content
    with tempfile.TemporaryDirectory(prefix=f".{target.name}.", dir=target.parent) as folder:
        whole = Path(folder) / target.name
        whole.write_bytes(data)
        whole.replace(target)
    return target
