"""What was read from a file, before anybody confirmed it: a summary for people, and the content.

A proposal lies in a folder of the station under a name that nobody guesses, until it is confirmed
or ``proposal_file.KEPT_S`` have passed. Nothing of it is part of a water before.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NotRequired

import numpy as np
import numpy.typing as npt
from typing_extensions import TypedDict

from autonomy.arrays import FloatArray
from server.water.proposal_file import keep_proposal, proposal_place

FOLDER = "water_proposals"
"""In the data folder."""
_SUFFIX = ".npz"
Role = Literal["outline", "island", "keep_out", "place", "ignored"]
Kind = Literal["shapes", "depths"]
LatitudeLongitude = tuple[float, float]


class ReadingError(ValueError):
    """A file is refused; each fault names its place (feature, line or field) and what is wrong."""

    def __init__(self, *faults: tuple[str, str]) -> None:
        super().__init__(
            "; ".join(f"{place}: {reason}" if place else reason for place, reason in faults)
        )
        self.faults = faults


class ReadingStoppedError(Exception):
    """Somebody cancelled the reading."""


class Fault(TypedDict):
    """What is wrong with a part of a file."""

    place: str
    """Feature, line or field; "" for the whole file."""
    reason: str


class ImportRefusal(TypedDict):
    """Why a file was refused."""

    errors: list[Fault]


class Extent(TypedDict):
    """Where what was read lies, WGS84 degrees."""

    south: float
    west: float
    north: float
    east: float


class ReadFeature(TypedDict):
    """One feature of a file of shapes."""

    number: int
    """From 1, in the file's order."""
    name: str
    role: str
    """``outline``, ``island``, ``keep_out``, ``place`` or ``ignored``, as it would be taken."""
    geometry: str
    """``polygon``, ``point`` or ``line``."""
    corners: int
    holes: int
    sketch: list[list[LatitudeLongitude]]
    """Its rings with few corners, as a map shows them before they are taken; latitude first."""


class ReadDepths(TypedDict):
    """What a file of depths holds."""

    rows: int
    columns: int
    spacing_m: float
    """Distance between two points of the grid, the larger one."""
    are_heights: bool
    """Whether depths are negative heights in the file, as it would be taken."""
    shallowest_m: float
    deepest_m: float
    """Depths below the file's datum, positive down; the shallowest of what is no land."""
    land_share: float
    """Share of the points that are on land."""
    unknown_share: float
    """Share of the points of which the file says nothing; they are taken as land."""


class ImportProposal(TypedDict):
    """What an import would bring, for an operator to confirm; nothing is kept before."""

    proposal: str
    """Name by which it is confirmed: in ``proposals`` of `POST` or `PATCH /api/waters`."""
    kind: str
    """``shapes`` or ``depths``."""
    file: str
    format: str
    crs: str
    """Coordinate reference system of the file, in words."""
    datum: str
    """Its geodetic datum."""
    extent: Extent
    origin_latitude_deg: float
    origin_longitude_deg: float
    """Middle of the extent: origin of the frame of a new water."""
    features: list[ReadFeature]
    features_total: int
    """How many there are; the list holds the first 500."""
    depths: NotRequired[ReadDepths]
    warnings: list[str]


@dataclass(slots=True)
class Shape:
    """One feature in WGS84 degrees."""

    number: int
    name: str
    geometry: Literal["polygon", "point", "line"]
    rings: list[list[LatitudeLongitude]]
    """The outer ring and its holes, without repeating the first corner; of others one list."""
    role: Role = "ignored"
    place_kind: str = "landmark"
    depth_m: float = 0.0
    heights_m: list[float | None] = field(default_factory=list)
    """Of each place of a line or point, positive up as in the file; None where it says none."""
    altitude_mode: str = ""
    """What KML says of the heights."""
    are_closed: bool = True
    """Whether the file repeats the first corner of each ring at its end."""
    words: Mapping[str, Any] = field(default_factory=dict)
    """What else the file says of the feature."""


@dataclass(slots=True)
class DepthField:
    """A grid of depths in the coordinates of its file."""

    x: FloatArray
    """Ascending, shape ``(columns,)``: longitudes or eastings of ``crs``."""
    y: FloatArray
    """Ascending, shape ``(rows,)``: latitudes or northings of ``crs``."""
    values: npt.NDArray[np.float32]
    """As the file has them, NaN where it says nothing, shape ``(rows, columns)``."""
    crs: str
    """WKT, or ``EPSG:4326``; x is the longitude or the easting."""
    are_heights: bool


@dataclass(slots=True)
class Reading:
    """What was read from a file."""

    format: str
    crs: str = "WGS 84 (EPSG:4326)"
    datum: str = "World Geodetic System 1984"
    shapes: list[Shape] = field(default_factory=list)
    depths: DepthField | None = None
    warnings: list[str] = field(default_factory=list)


def keep_reading(folder: Path, token: str, reading: Reading) -> None:
    """Write what was read, whole or not at all; forget what nobody confirmed."""
    grid = reading.depths
    shapes = [
        {
            "number": each.number,
            "name": each.name,
            "geometry": each.geometry,
            "rings": each.rings,
            "role": each.role,
            "place_kind": each.place_kind,
            "depth_m": each.depth_m,
        }
        for each in reading.shapes
    ]
    arrays: dict[str, Any] = {"shapes": np.frombuffer(json.dumps(shapes).encode(), np.uint8)}
    if grid is not None:
        arrays |= {"x": grid.x, "y": grid.y, "values": grid.values}
        head = {"crs": grid.crs, "are_heights": grid.are_heights}
        arrays["grid"] = np.frombuffer(json.dumps(head).encode(), np.uint8)
    name = proposal_place(folder, token, _SUFFIX).name
    keep_proposal(folder, name, lambda file: np.savez(file, **arrays))


def load_reading(folder: Path, token: str) -> Reading:
    """Return what was read under a name.

    Raises:
        FileNotFoundError: If there is nothing of this name any more.
    """
    with np.load(proposal_place(folder, token, _SUFFIX), allow_pickle=False) as arrays:
        told: list[dict[str, Any]] = json.loads(arrays["shapes"].tobytes())
        for each in told:
            each["rings"] = [[(at[0], at[1]) for at in ring] for ring in each["rings"]]
        shapes = [Shape(**each) for each in told]
        grid = None
        if "grid" in arrays:
            head = json.loads(arrays["grid"].tobytes())
            grid = DepthField(arrays["x"], arrays["y"], arrays["values"], **head)
    return Reading("", shapes=shapes, depths=grid)


def extent_of(places: Sequence[LatitudeLongitude]) -> Extent:
    """Return the bounds of places."""
    south, west = np.min(places, axis=0).tolist()
    north, east = np.max(places, axis=0).tolist()
    return Extent(south=south, west=west, north=north, east=east)


def refusal(error: ReadingError) -> Mapping[str, Any]:
    """Return a refusal as the result of a job."""
    return ImportRefusal(errors=[Fault(place=p, reason=r) for p, r in error.faults])
