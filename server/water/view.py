"""Waters as REST shows them."""

from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Literal

from pydantic import Field

from autonomy.site import Site
from server.base.text import Title
from server.base.view import Body, View


@dataclass(frozen=True, slots=True)
class WaterView(View):
    """A water in which robots work."""

    id: str
    name: str
    document: Site
    """Frame, box, outline, islands, floor, keep-outs and places. Beside a ``chart``, outline and
    floor are coarser ones that leave the chart's water nowhere; `GET /api/waters/{id}/outline` and
    `/depths` have them in full."""
    version: int
    """Grows with each change; quoted, it is the ``ETag``."""
    robots: list[str]
    """Those that work there."""
    created_at: datetime
    created_by: str
    changed_at: datetime
    is_retired: bool
    """Whether no robot can be put there."""


@dataclass(frozen=True, slots=True)
class DepthsView(View):
    """Depth of the floor at the crossings of lines, as many as were asked for."""

    north_m: list[float]
    east_m: list[float]
    depth_m: list[list[float]]
    """A row for each north line; 0 or less on land. The water's tide offset is counted."""
    datum: str
    tide_offset_m: float


class ConfirmedProposal(Body):
    """A proposal of `POST /api/waters/imports` as the operator confirms it."""

    proposal: str = Field(pattern=r"^[0-9a-z]{8,64}$")
    """Id of the proposal that was read from a file."""
    are_heights: bool | None = None
    """Whether depths are negative heights; ``null`` for as it was proposed."""
    roles: dict[int, Literal["outline", "island", "keep_out", "place", "ignored"]] = Field(
        default_factory=dict
    )
    """Other roles of features, by their numbers."""


WaterId = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,39}$")]
"""Short name: lower-case letters, digits and dashes."""


class WaterWords(Body):
    """What can be said of a water in a word or a number; ``null`` leaves it."""

    name: Title | None = None
    """What lists call it."""
    kind: Literal["tank", "lake", "sea"] | None = None
    """What kind of water it is."""
    variable: str | None = Field(default=None, pattern=r"^[a-z][a-z0-9_]{0,59}$")
    """Key of the channel that a survey maps."""
    radio_under_water: bool | None = None
    """Whether radio reaches robots that are under water, as in a tank."""
    depth_datum: str | None = Field(default=None, max_length=200)
    """What the depths count from, in words."""
    tide_offset_m: float | None = Field(default=None, ge=-20.0, le=20.0)
    """How much higher the surface is taken to stand than that."""
    surface_altitude_m: float | None = Field(default=None, ge=-500.0, le=9000.0)
    """How high the surface stands above mean sea level, for files that tell altitudes."""
    depth_max_m: float | None = Field(default=None, gt=0.0, le=12_000.0)
    """How deep the water is; needed where neither document nor grid tells."""
    proposals: list[ConfirmedProposal] = Field(default_factory=list, max_length=20)
    """What was read from files and is to be part of the water, in this order."""


class NewWater(WaterWords):
    """A water to add: by its document, by proposals, or both."""

    id: WaterId | None = None
    """By default made of the name."""
    document: Site | None = None
    """The whole document; without one the proposals must hold an outline or depths."""


class WaterChanges(WaterWords):
    """What is to be changed of a water."""

    document: Site | None = None
    """Replaces the whole document, before the words and proposals beside it are taken in."""
    is_retired: bool | None = None
    """Retire it, which 409 refuses while robots work there, or bring it back."""
