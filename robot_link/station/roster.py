"""The robots that a station talks to, and whose radio speaks for which of them."""

import logging
from collections.abc import Callable, Iterator

from robot_link.clock import monotonic_s
from robot_link.mavlink.codec import ROBOT_COMPONENT, Codec, WireMessage
from robot_link.mavlink.signing import Signing, Verdict
from robot_link.mavlink.standard_vehicle import StandardVehicle
from robot_link.mavlink.status_text import StatusTexts
from robot_link.messages import RobotId, SystemId
from robot_link.service.duplicate import TOLD_S, DuplicateWatch
from robot_link.station.command_lane import CommandLane
from robot_link.station.fix_sender import FixPace
from robot_link.station.path import PeerPath, RobotEndpoint
from robot_link.station.peer import Peer
from robot_link.station.robot_services import RobotServices
from robot_link.station.upload import Upload
from robot_link.transport.datagram import FAR_END, Address, DatagramTransport, Received, Stranger

_log = logging.getLogger(__name__)


class Member:
    """One robot with everything that talks to it."""

    def __init__(
        self,
        endpoint: RobotEndpoint,
        peer: Peer,
        lane: CommandLane,
        codec: Codec,
        signing: Signing | None,
        pace: FixPace,
        vehicle: StandardVehicle | None = None,
    ) -> None:
        self.endpoint = endpoint
        self.peer = peer
        self.lane = lane
        self.codec = codec
        """Packs what goes to this robot."""
        self.signing = signing
        self.vehicle = vehicle
        """Puts together what a vehicle of another maker says."""
        self.texts = StatusTexts()
        """Puts together the sentences of a robot of ours."""
        self.services = RobotServices(peer, pace, is_standard=vehicle is not None)
        self.upload: Upload | None = None
        """The upload under way."""

    def foreign(self) -> StandardVehicle:
        """Return what puts together a vehicle of another maker.

        Raises:
            KeyError: If it is a robot of ours.
        """
        if self.vehicle is None:
            raise KeyError(self.robot)
        return self.vehicle

    @property
    def robot(self) -> RobotId:
        """Name of the robot."""
        return self.peer.robot


class Roster:
    """Finds the robot that a frame is from; counts what is nobody's.

    A radio that speaks under the system id of a robot whose radio is another one is not believed;
    it is remembered for the operator. Two robots under one id on a line without addresses cannot
    be told apart; that they are two is noticed, and remembered too.
    """

    def __init__(self) -> None:
        self._members: dict[RobotId, Member] = {}
        self._by_system: dict[SystemId, Member] = {}
        self._duplicates = DuplicateWatch()
        self.on_conflict: Callable[[Member], None] = _ignore
        """Called at once when another is heard under a robot's system id."""

    def __iter__(self) -> Iterator[Member]:
        return iter(self._members.values())

    def __getitem__(self, robot: RobotId) -> Member:
        return self._members[robot]

    def get(self, robot: RobotId) -> Member | None:
        """Return a robot, None where there is none of this name."""
        return self._members.get(robot)

    def add(self, member: Member) -> None:
        """Talk to another robot."""
        self._members[member.robot] = member
        self._by_system[member.peer.system] = member

    def remove(self, robot: RobotId) -> None:
        """Talk to a robot no more."""
        member = self._members.pop(robot)
        if self._by_system.get(member.peer.system) is member:
            del self._by_system[member.peer.system]

    def conflict(self, member: Member) -> str:
        """Return a sentence on others that speak under this robot's system id, or ""."""
        now_s, system = monotonic_s(), member.peer.system
        mixed = [
            f"two robots speak as system {system} on {path.uri}; what is shown may be of both:"
            " give one of them another system id"
            for path in member.peer.paths
            if path.numbers.is_double(now_s)
        ]
        mixed += [
            path.stranger
            for path in member.peer.paths
            if path.stranger and now_s - path.stranger_s <= TOLD_S
        ]
        if _is_heard(member):
            mixed += [
                f"{path.unproved} speaks as system {system}, too, without its key; it is not obeyed"
                for path in self._unproved_paths(member)
            ]
        return "; ".join(filter(None, (self._duplicates.sentence(system, now_s), *mixed)))

    def unproved(self, member: Member) -> str:
        """Return a sentence on a robot of which only frames without its key come, or ""."""
        if _is_heard(member):
            return ""
        return "; ".join(
            f"what {path.unproved} says as system {member.peer.system} is not signed with the key"
            f" of {member.robot} and is not believed: put the key into the robot"
            for path in self._unproved_paths(member)
        )

    def _unproved_paths(self, member: Member) -> list[PeerPath]:
        now_s = monotonic_s()
        return [
            path
            for path in member.peer.paths
            if path.unproved and now_s - path.unproved_s <= TOLD_S
        ]

    def note_stranger(
        self, transport: DatagramTransport, stranger: Stranger, messages: list[WireMessage]
    ) -> None:
        """Note that somebody else speaks for a robot on a line that has one far end."""
        for system in {SystemId(message.get_srcSystem()) for message in messages}:
            member = self._by_system.get(system)
            path = None if member is None else member.peer.path_on(transport)
            if member is None or path is None:
                continue
            fate = (
                "it has taken the place of the one that was silent"
                if stranger.took_over
                else "it is not obeyed"
            )
            path.stranger = f"{stranger.where} speaks as system {system}, too; {fate}"
            path.stranger_s = monotonic_s()
            self._tell(member)

    def _tell(self, member: Member) -> None:
        _log.warning("%s: %s", member.robot, self.conflict(member) or self.unproved(member))
        self.on_conflict(member)

    def attributed(
        self, transport: DatagramTransport, received: Received, messages: list[WireMessage]
    ) -> tuple[Member | None, list[WireMessage]]:
        """Return whose datagram this is, and which of its messages are believed."""
        trusted = [one for one in messages if self._is_trusted(one, transport, received)]
        sender = self._at(transport, received.address)
        if sender is None and trusted:
            sender = self._bound(transport, received.address, trusted[0])
        if sender is None:
            return None, []
        system = sender.peer.system
        own = [message for message in trusted if message.get_srcSystem() == system]
        if received.address == FAR_END:
            self._note_numbers(sender, transport, own)
        return sender, own

    def count_bad(self, transport: DatagramTransport, sender: Member | None, frames: int) -> None:
        """Count dropped frames for their sender, or for every robot of the radio."""
        for member in self if sender is None else (sender,):
            member.peer.count_bad(transport, frames)

    def _note_numbers(
        self, sender: Member, transport: DatagramTransport, own: list[WireMessage]
    ) -> None:
        path, now_s = sender.peer.path_on(transport), monotonic_s()
        for message in own:
            if path is None or message.get_srcComponent() != ROBOT_COMPONENT:
                continue
            if path.numbers.note(message.get_seq(), now_s):
                self._tell(sender)

    def _is_trusted(
        self, message: WireMessage, transport: DatagramTransport, received: Received
    ) -> bool:
        """Tell whether a message is signed by the robot's key, where it has one."""
        member = self._by_system.get(SystemId(message.get_srcSystem()))
        if member is None or member.signing is None:
            return True
        verdict = member.signing.check(bytes(message.get_msgbuf()))
        if verdict in (Verdict.UNSIGNED, Verdict.FORGED):
            self._note_unproved(member, transport, received)
        return verdict is Verdict.GOOD

    def _note_unproved(
        self, member: Member, transport: DatagramTransport, received: Received
    ) -> None:
        """Note somebody who speaks for a robot without its key: another one, or itself."""
        path, now_s = member.peer.path_on(transport), monotonic_s()
        if path is None:
            return
        if path.address not in (None, received.address):
            is_news = self._duplicates.note(member.peer.system, received.address, now_s)
        else:
            is_news = not path.unproved or now_s - path.unproved_s > TOLD_S
            radio = f"the radio {received.address:016X}" if received.address else ""
            path.unproved = received.where or radio or f"somebody on {path.uri}"
            path.unproved_s = now_s
        if is_news:
            self._tell(member)

    def _at(self, transport: DatagramTransport, address: Address) -> Member | None:
        for member in self:
            if member.peer.speaks_at(transport, address):
                return member
        return None

    def _bound(
        self, transport: DatagramTransport, address: Address, message: WireMessage
    ) -> Member | None:
        """Return the robot that an unknown radio speaks for, if that robot has no radio yet."""
        system = SystemId(message.get_srcSystem())
        member = self._by_system.get(system)
        if member is None or member.peer.path_on(transport) is None:
            return None
        if member.peer.is_unbound_on(transport):
            return member
        now_s = monotonic_s()
        if self._duplicates.note(system, address, now_s):
            self._tell(member)
        return None


def _is_heard(member: Member) -> bool:
    """Tell whether a robot was heard of late, by whatever link: who lacks its key is another."""
    return any(path.is_fresh(TOLD_S) for path in member.peer.paths)


def _ignore(member: Member) -> None:
    del member
