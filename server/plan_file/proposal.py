"""What was read from a plan file, before anybody confirmed it; nothing of it is kept."""

from dataclasses import dataclass, field
from typing import Literal

from pydantic import Field

from autonomy.configuration import Configuration
from autonomy.described import Described
from autonomy.design.document import Design

LatitudeLongitude = tuple[float, float]
NorthEast = tuple[float, float]
AreaRole = Literal["outline", "keep_out", "survey"]
MarkKind = Literal["home", "rally", "place"]


class ReadChoices(Configuration):
    """How an operator answered what a file leaves open; each is a ``Question`` of a proposal."""

    turns_sign: bool = False
    """The whole file means depths by the other sign: positive altitudes, or negative depths."""
    default_depth_m: float | None = Field(default=None, ge=0.0, le=12_000.0)
    """Depth of all places of which the file says none."""
    surface_altitude_m: float | None = Field(default=None, ge=-500.0, le=9000.0)
    """How high the water's surface stands above mean sea level, for absolute altitudes."""
    land_surfaces: bool = False
    """A landing means coming up at its place."""
    takes_transects: bool = False
    """Take the transects of a survey instead of its area."""
    is_moved: bool = False
    """Move everything so that its middle lies in the middle of the water's domain."""
    area: int | None = Field(default=None, ge=1)
    """Number of an area to be covered by a lawnmower instead of the waypoints."""
    imports_rest: bool = False
    """Leave out what is refused and take the rest."""


@dataclass(frozen=True, slots=True)
class Refusal(Described):
    """A part of the file that is not taken."""

    place: str
    """Item, line or feature, such as ``item 4``."""
    value: str
    """What stands there, such as ``command 18 (loiter turns)``; "" where there is no value."""
    reason: str


@dataclass(frozen=True, slots=True)
class Question(Described):
    """What the file leaves open; its key is a field of ``ReadChoices``."""

    key: str
    text: str
    unit: str = ""
    """Of a number that is asked for; "" for yes or no, and for the number of an area."""
    is_needed: bool = False
    """Whether nothing may be made of the file before it is answered."""


@dataclass(frozen=True, slots=True)
class ReadArea(Described):
    """A polygon of the file."""

    number: int
    """From 1, in the file's order."""
    name: str
    role: AreaRole
    corners_deg: tuple[LatitudeLongitude, ...]
    """As the file has them, without repeating the first."""
    corners_m: tuple[NorthEast, ...]
    """In the water's frame, moved if that was asked for."""
    area_m2: float
    circumference_m: float
    note: str = ""
    """What else the file says, such as the radius of a circle."""


@dataclass(frozen=True, slots=True)
class ReadMark:
    """A place of the file that is not flown to."""

    name: str
    kind: MarkKind
    place_deg: LatitudeLongitude
    place_m: NorthEast
    note: str = ""


@dataclass(frozen=True, slots=True)
class PlanFileProposal:
    """What a plan file would bring, for an operator to confirm."""

    format: str
    """In words, such as ``QGroundControl plan``."""
    document: Design
    """The design that could be made of it, as the choices are now."""
    distance_m: float
    """Length of the way from the first waypoint to the last, along the surface."""
    notes: tuple[str, ...] = ()
    refused: tuple[Refusal, ...] = ()
    needs: tuple[Question, ...] = ()
    """Questions that are open or may be answered otherwise."""
    areas: tuple[ReadArea, ...] = ()
    marks: tuple[ReadMark, ...] = ()

    @property
    def is_ready(self) -> bool:
        """Whether a design may be made of it: nothing that is needed is open."""
        return not any(question.is_needed for question in self.needs)


@dataclass(slots=True)
class Findings:
    """What readers note down as they go through a file."""

    notes: list[str] = field(default_factory=list)
    refused: list[Refusal] = field(default_factory=list)
    needs: dict[str, Question] = field(default_factory=dict)
    areas: list[ReadArea] = field(default_factory=list)
    marks: list[ReadMark] = field(default_factory=list)
    says_depths: bool = False
    """Whether the file says depths, positive down, and not altitudes."""

    def refuse(self, place: str, value: str, reason: str) -> None:
        """Note a part that is not taken."""
        self.refused.append(Refusal(place, value, reason))

    def ask(self, key: str, text: str, unit: str = "", *, is_needed: bool = False) -> None:
        """Note a question, once."""
        self.needs.setdefault(key, Question(key, text, unit, is_needed))
