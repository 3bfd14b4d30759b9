"""A robot's hull: its size, the water that it displaces, and how it gives under pressure."""

from autonomy.configuration import Configuration, quantity


class Hull(Configuration):
    """Outer sizes and displacement of a robot; the defaults are the Miniglider's (Table 2.2)."""

    length_m: float = quantity(0.40, "m", title="Hull length", gt=0.0)
    """Length of the hull without tail."""
    width_m: float = quantity(0.12, "m", title="Hull width", gt=0.0)
    """Width of the hull without wings."""
    height_m: float = quantity(0.12, "m", title="Hull height", gt=0.0)
    """Height of the hull."""
    tail_to_nose_m: float = quantity(0.57, "m", title="Tail to nose", gt=0.0)
    """Length over all, from the tip of the tail to the nose."""
    wingspan_m: float = quantity(0.37, "m", title="Wingspan", gt=0.0)
    """From wing tip to wing tip."""
    displaced_mass_kg: float = quantity(5.0, "kg", title="Displaced mass", gt=0.0)
    """Mass of the water that the sealed parts displace: the robot's weight, as it nearly floats.
    Denser water lifts the robot in proportion to it."""
    compressibility_per_m: float = quantity(
        0.0, "1/m", title="Compressibility", ge=0.0, le=1e-3, advanced=True
    )
    """Part of its volume that the hull loses by metre of depth. The thesis tells of a shell that
    gave so much that the pump could no longer lift the robot (section 2.1.1) but no number, so it
    is 0 here; water itself gives 4.6e-6 of its volume by metre."""
