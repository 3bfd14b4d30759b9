"""Colours of the 3D scene: perceptually uniform maps and the fixed colours of meanings.

The map anchors are ten equally spaced colours of matplotlib's maps (all CC0).
"""

import numpy as np
import numpy.typing as npt

from autonomy.arrays import FloatArray

ColourArray = npt.NDArray[np.uint8]
Colour = tuple[int, int, int]

_ANCHORS = {
    "viridis": "440154 482878 3e4989 31688e 26828e 1f9e89 35b779 6dcd59 b4de2c fde725",
    "magma": "000004 180f3e 451077 721f81 9f2f7f cd4071 f1605d fd9567 fec98d fcfdbf",
    "cividis": "00224e 123570 3b496c 575d6d 707173 8a8779 a69d75 c4b56c e4cf5b fee838",
}

FIDELITY: tuple[Colour, ...] = ((124, 108, 214), (86, 160, 230), (160, 240, 225))
"""Worst located, in between, best located; more levels share the outer two."""
PRIMITIVE: dict[str, Colour] = {
    "glide": (74, 163, 255),
    "spiral": (196, 140, 255),
    "dive": (255, 176, 92),
    "swim": (120, 220, 160),
    "keep": (120, 220, 160),
}
DRIFT: Colour = (104, 116, 128)
"""Where the robot floated at the surface between missions; no measurement of it matters."""
REFERENCE: Colour = (214, 222, 230)
RUNS: tuple[Colour, ...] = (
    (86, 180, 233), (230, 159, 0), (72, 199, 142), (240, 228, 66), (222, 140, 190), (236, 112, 64),
)  # fmt: skip
"""Controllers of a what-if run in the order they were chosen, told apart by the colour-blind too
(after Okabe and Ito, made lighter for a dark ground)."""
DOMAIN: Colour = (88, 166, 255)
WATER: Colour = (58, 138, 190)
EDGE: Colour = (160, 182, 205)
FLOOR: Colour = (16, 24, 32)
ROBOT: Colour = (250, 204, 60)
ROBOT_OLD: Colour = (128, 134, 140)
UNCERTAINTY: Colour = (160, 205, 255)
KEEP_OUT: Colour = (242, 104, 108)
SHORE: Colour = (127, 184, 164)
LAKE_BED: Colour = (74, 92, 104)
TARGET: Colour = (255, 138, 101)
"""Where a robot believes its target to be, and how far it heard that it is."""
TARGET_TRUE: Colour = (236, 240, 244)
"""Where a virtual target really is."""
TARGET_OLD: Colour = ROBOT_OLD
PREDICTED: Colour = (233, 196, 255)
"""Where a robot that is not heard should be; its own word has another colour."""
BY_CAMERA: Colour = (255, 122, 190)
"""Where cameras over the water saw the robot: nobody's estimate but theirs."""
BAND: Colour = (110, 196, 186)
"""Where most flights of a rehearsal were; bluish green, so that it is no uncertainty of the robot's
own and no current."""
REHEARSED: Colour = (226, 214, 170)
"""Where a rehearsal went: computed, not flown, and not what was promised either."""


def mapped(values: FloatArray, low: float, high: float, name: str) -> ColourArray:
    """Colour values between ``low`` and ``high``; what lies outside takes the end colours.

    Args:
        values: Any shape; NaN is drawn as the lowest colour.
        low: Value of the first colour.
        high: Value of the last colour; equal to ``low`` gives the middle colour everywhere.
        name: As the catalogue of channels names colour maps.

    Returns:
        Colours 0..255, shape ``(*values.shape, 3)``.
    """
    span = high - low
    share = np.full(values.shape, 0.5) if span <= 0 else (values - low) / span
    share = np.clip(np.nan_to_num(share), 0.0, 1.0)
    anchors = np.array([[int(a[i : i + 2], 16) for i in (0, 2, 4)] for a in _ANCHORS[name].split()])
    stops = np.linspace(0.0, 1.0, len(anchors))
    return np.stack([np.interp(share, stops, anchors[:, c]) for c in range(3)], axis=-1).astype(
        np.uint8
    )


def fidelity_colours(levels: npt.NDArray[np.int64], count: int) -> ColourArray:
    """Colour fidelity levels ``0 .. count - 1``, the best located brightest; shape ``(n, 3)``."""
    place = np.rint(levels / max(count - 1, 1) * (len(FIDELITY) - 1)).astype(int)
    return np.array(FIDELITY, dtype=np.uint8)[np.clip(place, 0, len(FIDELITY) - 1)]


def linear(colours: ColourArray | Colour) -> ColourArray:
    """Undo the screen's gamma: viser hands colours of lines and instances on as linear light."""
    return np.rint(255.0 * (np.asarray(colours) / 255.0) ** 2.2).astype(np.uint8)
