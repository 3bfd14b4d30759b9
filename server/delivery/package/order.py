"""What is asked of a delivery: which file, and what goes with it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from server.delivery.file_order import FileOrder
from server.delivery.file_task import KeptFile

_CHECKERS: Final = ("compliance-checker", "cc-plugin-og")


@dataclass(frozen=True, slots=True)
class EarlierFile:
    """A file that was written before, and that a delivery may have in it as it is."""

    id: str
    kept: KeptFile
    written_at: datetime
    history: str


@dataclass(frozen=True, slots=True)
class PackageOrder:
    """What is to be packed."""

    file: FileOrder
    """What is to be written where the rows are not those of the earlier file."""
    earlier: EarlierFile | None
    """Of the same words and rules as would be written now; the rows decide."""
    has_journal: bool
    """Whether the packets of the robot are to be in it."""
    data_dir: Path
    """Where the log book's pictures lie."""


def words_sha256(order: FileOrder) -> str:
    """Return a hash over all that a file says but its rows, and the moment of writing."""
    wanted, deployment = order.wanted, order.wanted.deployment
    words: Mapping[str, Any] = {
        "deployment": [deployment.id, deployment.title, deployment.purpose],
        "times": [str(deployment.started_at), str(deployment.last_at)],
        "site": deployment.site.model_dump(mode="json"),
        "robot": [order.robot.id, order.robot.name, order.robot.model, order.robot.kind],
        "links": list(order.robot.links),
        "channels": {key: repr(channel) for key, channel in order.channels.items()},
        "believable": dict(wanted.believable),
        "metadata": order.metadata.model_dump(mode="json"),
        "rules": wanted.rules.sha256,
        "manual": [repr(one) for one in order.manual],
        "thresholds_m": list(order.thresholds_m),
        "mode": [order.mode, order.signed_by, wanted.smoothed],
        "software": [order.software, *map(_version, _CHECKERS)],
    }
    text = json.dumps(words, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""
