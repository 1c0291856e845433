"""Events that damage in a file cost: how a reader tells of them beside the events that it gives."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from evimo.events.events import Events, joined


@dataclass(frozen=True, slots=True)
class MarredEvents(Events):
    """Events of a packet that may be damaged.

    lost: how many events the damage cost, here or just before.
    """

    lost: int = 0


class Damage(Protocol):
    """What counts the events that are lost to damage."""

    damaged: int


def marred(packets: Sequence[Events]) -> MarredEvents:
    """Packets that follow each other as one, with what all of them lost."""
    whole = joined(packets)
    return MarredEvents(whole.x, whole.y, whole.t, whole.p, lost=sum(map(lost_with, packets)))


def lost_with(packet: Events) -> int:
    """How many events were lost with a packet."""
    return packet.lost if isinstance(packet, MarredEvents) else 0


def mended(packets: Iterator[Events], damage: Damage) -> Iterator[Events]:
    """The packets that hold events; what was lost with any is counted."""
    for packet in packets:
        damage.damaged += lost_with(packet)
        if len(packet):
            yield packet
