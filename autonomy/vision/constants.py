"""Numbers that those need, too, who load no machine code: the process of the station."""

CAMERA_ERRORS = 16
"""Of each camera its place, its turn, its lens, its edges (``camera.Camera.moved``)."""
TELEMETRY_S = 1.0
"""What a robot said longer ago is not used to find it."""
GREATEST_SPREAD_M = 0.002
"""How far cameras may disagree on the water's level."""
