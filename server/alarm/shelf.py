"""Shelved alarms come back by themselves when their time is over."""

from db.query.station.alarms import AlarmRecord
from robot_link.clock import Clock
from server.base.alarm_board import AlarmBoard
from server.base.wakeups import Wakeups


class AlarmShelf:
    """Waits for the end of each shelf. Belongs to one event loop; ``run`` is its task."""

    def __init__(self, alarms: AlarmBoard, clock: Clock) -> None:
        self._alarms = alarms
        self._clock = clock
        self._ends = Wakeups(clock)

    def take(self, alarm: AlarmRecord) -> None:
        """Note until when an alarm is shelved, or that it is no longer."""
        self._ends.set_due(alarm.id, alarm.shelved_until)

    async def run(self) -> None:
        """Take alarms back until cancelled."""
        for alarm in self._alarms.open:
            self.take(alarm)
        while True:
            ended = set(await self._ends.next())
            now = self._clock.now()
            for alarm in self._alarms.open:
                until = alarm.shelved_until
                if alarm.id in ended and until is not None and until <= now:
                    await self._alarms.unshelve(alarm.id)
