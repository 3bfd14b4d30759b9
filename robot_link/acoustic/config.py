"""What turns an acoustic travel time into a range."""

from autonomy.configuration import Configuration, quantity


class AcousticConfig(Configuration):
    """Ranging with an acoustic modem."""

    sound_speed_m_s: float = quantity(1500.0, "m/s", title="Sound speed", ge=1300.0, le=1700.0)
    """Speed of sound between modem and robot; a CTD cast tells it better than a table."""
    range_max_m: float = quantity(1500.0, "m", title="Longest range", gt=0.0, le=20000.0)
    """An answer from farther away is not waited for."""
    period_s: float = quantity(60.0, "s", title="Time between pings", ge=5.0, le=86400.0)
    """How often each robot under water is asked for its range; pings cost it little."""
    turnaround_s: float = quantity(0.05, "s", title="Turnaround", ge=0.0, le=10.0, advanced=True)
    """Time that the far modem or transponder takes before it answers."""

    @property
    def travel_s(self) -> float:
        """How long the sound of an answer may take: there, back, and the turnaround."""
        return 2.0 * self.range_max_m / self.sound_speed_m_s + self.turnaround_s

    @property
    def answer_s(self) -> float:
        """How long an answer may take, with a second to spare."""
        return self.travel_s + 1.0
