"""Who is there: people, scripts and links are each their own, however they are called."""

from dataclasses import replace
from datetime import UTC, datetime

from server.access.caller import Caller, Proof
from server.access.presence import Presence, who
from server.access.role import Rights, Role
from server.base.event_bus import EventBus

ANN = Caller("ann", Rights(Role.PILOT), datetime.now(UTC), "csrf", Proof("session", "1"))


def test_a_read_only_link_that_is_called_as_a_pilot_does_not_pass_for_them():
    presence = Presence(EventBus())
    link = replace(ANN, rights=Rights(Role.NONE), proof=Proof("session", "2"), is_link=True)
    with presence.present(link):
        assert presence.is_open(who(link))
        assert not presence.is_open(who(ANN))
    with presence.present(ANN):
        assert presence.silent_s(who(ANN)) == 0.0
