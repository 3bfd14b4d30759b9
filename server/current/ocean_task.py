"""Reads an ocean model's file into a proposal, in a worker process."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from autonomy.current.ocean_file import OceanFileError, OceanReading, read_ocean_file
from autonomy.current.told import keep_grid
from autonomy.site import Site
from server.water.proposal_file import keep_proposal, proposal_place

TASK = f"{__name__}:run"
PROPOSAL_FOLDER = "current_proposals"
"""In the data folder."""
_SUFFIX = ".json"


class ReadingStoppedError(Exception):
    """Somebody cancelled the reading."""


class CurrentProposal(TypedDict):
    """What a file would tell of the current of a water, for an operator to confirm."""

    proposal: str
    """Name by which it is confirmed: in `PUT /api/waters/{id}/current`."""
    water: str
    file: str
    source: str
    """As the file tells; empty where it does not."""
    made_at: str | None
    valid_from: str
    valid_until: str
    times: int
    depths: int
    rows: int
    columns: int
    shallowest_m: float
    deepest_m: float
    fastest_m_s: float
    unknown_share: float
    """Share of the values of which the file says nothing."""
    warnings: list[str]
    sha256: str


@dataclass(frozen=True, slots=True)
class OceanOrder:
    """What is to be read."""

    path: Path
    file: str
    """Its name, as the operator knows it."""
    water: str
    site: Site
    proposal_folder: Path
    grid_folder: Path
    token: str


def run(
    order: OceanOrder, report: Callable[[object], None], is_cancelled: Callable[[], bool]
) -> dict[str, Any]:
    """Read a file and keep what was read as a proposal.

    Returns:
        ``CurrentProposal``, or ``{"error": text}``.
    """

    def tick(share: float) -> None:
        if is_cancelled():
            raise ReadingStoppedError
        report((0.1 + 0.8 * share, "Reading the file"))

    site = order.site
    origin = (site.origin_latitude_deg, site.origin_longitude_deg)
    try:
        reading = read_ocean_file(order.path, origin, site.water, tick)
    except OceanFileError as error:
        return {"error": f"{order.file}: {error}."}
    proposal = _proposal(order, reading)
    content = json.dumps(proposal).encode()
    name = proposal_place(order.proposal_folder, order.token, _SUFFIX).name
    keep_proposal(order.proposal_folder, name, lambda file: file.write(content))
    return dict(proposal)


def load_proposal(folder: Path, token: str) -> CurrentProposal | None:
    """Return a proposal, None where there is none of this name any more."""
    try:
        return json.loads(proposal_place(folder, token, _SUFFIX).read_text())
    except OSError:
        return None


def told_words(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a confirmed proposal tells, as ``KeptTold`` takes it."""
    said = {name: found[name] for name in ("made_at", "valid_from", "valid_until", "sha256")}
    return {**said, "kind": "gridded", "source": found["source"] or found["file"]}


def _proposal(order: OceanOrder, reading: OceanReading) -> CurrentProposal:
    grid, made_at = reading.grid, reading.made_at
    times, depths, rows, columns, _ = grid.velocity.shape
    return CurrentProposal(
        proposal=order.token,
        water=order.water,
        file=order.file,
        source=reading.source,
        made_at=None if made_at is None else made_at.isoformat(),
        valid_from=datetime.fromtimestamp(grid.from_s, UTC).isoformat(),
        valid_until=datetime.fromtimestamp(grid.until_s, UTC).isoformat(),
        times=times,
        depths=depths,
        rows=rows,
        columns=columns,
        shallowest_m=float(grid.depth_m[0]),
        deepest_m=float(grid.depth_m[-1]),
        fastest_m_s=round(float(np.nanmax(np.hypot(*np.moveaxis(grid.velocity, -1, 0)))), 3),
        unknown_share=round(reading.unknown_share, 4),
        warnings=list(reading.warnings),
        sha256=keep_grid(order.grid_folder, grid),
    )
