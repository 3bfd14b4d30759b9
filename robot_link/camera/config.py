"""How cameras over a tank are used: the water, when a fix is taken, and what is told."""

from autonomy.configuration import Configuration, quantity


class CameraConfig(Configuration):
    """Cameras over the tank."""

    refraction_index: float = quantity(
        1.333, title="Index of refraction of the water", ge=1.30, le=1.36
    )
    """Fresh water at 20 degC has 1.333, sea water about 1.34. Used from the next adjustment on."""
    fix_rate_hz: float = quantity(5.0, "Hz", title="Fixes sent to a robot", ge=0.1, le=5.0)
    """At most so many a second, and never more than a tenth of what its radio carries."""
    rms_max: float = quantity(4.0, title="Greatest residual of a fix", ge=1.0, le=10.0)
    """A fix whose corners are farther off, in their standard deviations, is refused."""
    position_std_max_m: float = quantity(
        0.1, "m", title="Greatest uncertainty of a fix", ge=0.005, le=1.0, display_unit="mm"
    )
    """A fix that claims to be less sure along some axis is refused."""
    outside_max_m: float = quantity(0.3, "m", title="Farthest outside the water", ge=0.0, le=5.0)
    """A fix that lies farther outside the water is refused."""
    jump_max: float = quantity(
        16.3, title="Farthest from the prediction", ge=3.0, le=100.0, advanced=True
    )
    """Squared Mahalanobis distance of three axes; a fix beyond it is refused a few times in a
    row, then believed."""
    jumps_refused: int = quantity(5, title="Jumps refused in a row", ge=1, le=50, advanced=True)
    """So many fixes in a row beyond that distance are refused before one is believed."""
    together_s: float = quantity(
        0.06, "s", title="Pictures of one moment", ge=0.01, le=0.5, display_unit="ms", advanced=True
    )
    """Pictures of several cameras that were taken within this time make one fix."""
    silent_s: float = quantity(5.0, "s", title="Silent after", ge=1.0, le=60.0)
    """A camera that sends no picture for so long is started again."""
    silent_alarm_s: float = quantity(10.0, "s", title="Alarm of silence after", ge=2.0, le=600.0)
    """Somebody is told of a camera that sent no picture for so long."""
    moved_px: float = quantity(0.7, "px", title="Moved from", ge=0.2, le=10.0)
    """Somebody is told of a camera whose fixed tags lie so far from where they should."""
    left_out_px: float = quantity(2.0, "px", title="Left out from", ge=0.5, le=20.0)
    """A camera whose fixed tags are so far off is not used until it is adjusted again."""
    level_told_m: float = quantity(
        0.005, "m", title="Change of level told from", ge=0.001, le=0.1, display_unit="mm"
    )
    """Somebody is told of a change of the water's level that is so large."""
