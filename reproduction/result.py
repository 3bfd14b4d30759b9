"""What a reproduction hands over: numbers beside the thesis's, their scenario, and a figure."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal

from autonomy.arrays import FloatArray

Report = Callable[[float, str], None]
"""Takes how much is done, in 0 .. 1, and what is being done."""


class Hue(StrEnum):
    """What a colour stands for; the same thing has the same colour in every figure."""

    PROPOSED = "proposed"
    BASELINE = "baseline"
    PID = "PID"
    REFERENCE = "reference"
    FAINT = "faint"
    SINGLE = "single"
    RECURSIVE = "recursive"
    JOINT = "joint"
    POSITION_NOISE = "position noise"
    MFE = "MFE"
    MFIG = "MFIG"
    SFE = "SFE"
    SFIG = "SFIG"
    TARGET = "target"
    BARRIER = "barrier"
    THESIS_BARRIER = "barrier of the thesis"
    NOMINAL = "nominal"
    MPC_NONE = "MPC, tracking alone"
    MPC_TRACE = "MPC, trace"
    MPC_DETERMINANT = "MPC, determinant"
    MPC_CONDITION = "MPC, condition"
    CUBIC = "cubic"
    ZERO = "zero"
    NEGATIVE = "negative"
    SLIGHTLY_NEGATIVE = "slightly negative"
    ROOT = "root"
    CONSTANT = "constant"
    STATE = "state feedback"
    OUTPUT = "output feedback"
    STATE_BARRIER = "state feedback, barrier"
    OUTPUT_BARRIER = "output feedback, barrier"
    ESTIMATED_BARRIER = "target velocity estimated, barrier"


class Mark(StrEnum):
    """How a series is drawn."""

    LINE = "line"
    DASHED = "dashed"
    THIN = "thin"
    FILLED = "filled dots"
    HOLLOW = "hollow dots"


@dataclass(frozen=True, slots=True)
class Row:
    """One number of ours beside the thesis's."""

    row: str
    column: str
    ours: float
    thesis: float | None
    """None where the thesis prints none."""
    unit: str
    """"" for a number without unit."""


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Points of one line or one kind of dots; a NaN interrupts a line."""

    label: str
    """In the legend; a second series of the same label is not listed again, "" never is."""
    x: FloatArray
    y: FloatArray
    hue: Hue
    mark: Mark = Mark.LINE
    x_bounds: tuple[FloatArray, FloatArray] | None = None
    """Ends of a horizontal bar through each point."""
    y_bounds: tuple[FloatArray, FloatArray] | None = None
    """Ends of a vertical bar through each point."""
    band: tuple[FloatArray, FloatArray] | None = None
    """Lower and upper edge of an area around the line."""


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One pair of axes."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    names: tuple[str, ...] = ()
    """Words in place of the numbers 0, 1, ... on the vertical axis, from the top down."""
    x_names: tuple[str, ...] = ()
    """Words in place of the numbers 0, 1, ... on the horizontal axis."""
    logarithmic: Literal["", "x", "y"] = ""
    """Which axis is."""
    y_range: tuple[float, float] | None = None
    is_plane: bool = False
    """Whether both axes are metres of a vertical plane: alike in scale, depth growing downwards."""
    is_map: bool = False
    """Whether both axes are metres of the horizontal plane, alike in scale."""
    inset: "Panel | None" = None
    inset_at: tuple[float, float] = (0.0, 0.0)
    """Lower left corner of the inset, as a share of the axes."""


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """Panels row by row, under one title and one legend."""

    panels: tuple[Panel, ...]
    columns: int
    caption: str = ""
    """A sentence below: what a reader must know to read the marks."""


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """One table or figure of the thesis, worked out anew."""

    name: str
    title: str
    scenario: Mapping[str, Any]
    """Everything that was set, in words and numbers that JSON can hold."""
    rows: tuple[Row, ...]
    figure: Figure
    notes: tuple[str, ...] = field(default=())
    """Sentences: what holds, what does not, what the thesis leaves open."""
