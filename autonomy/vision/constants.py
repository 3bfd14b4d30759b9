"""Numbers that those need, too, who load no machine code: the process of the station."""

CAMERA_ERRORS = 16
"""What may be wrong of one camera, in order: its place in NED (3, m), its turn about its own axes
(3, rad), the lens's parameters (9), and its edge shift (px)."""
TELEMETRY_S = 1.0
"""What a robot said longer ago is not used to find it."""
GREATEST_CHANGE_M = 0.030
"""A level of the water that changed by more is not applied by itself."""
GREATEST_SPREAD_M = 0.002
"""So far do cameras agree on one level."""
