"""The life of its node that a message belongs to."""

from cnctwin.kafka.bridge.origins import Origins
from sparkplug.host_event import EventKind, HostEvent
from sparkplug.metric import NodeId
from sparkplug.node_picture import NodePicture
from sparkplug.records.record import Origin

NODE = NodeId("cnc", "edge-okuma")


def test_a_birth_of_the_node_begins_a_life_and_the_rest_belongs_to_it() -> None:
    picture = NodePicture(NODE)
    origins = Origins(lambda _: picture)
    for bd_seq, born_ms in ((0, 1000), (1, 9000)):
        picture.bd_seq = bd_seq
        assert origins.of(HostEvent(EventKind.BIRTH, NODE, None, born_ms, seq=0)) == Origin(bd_seq, born_ms, 0)
        assert origins.of(HostEvent(EventKind.BIRTH, NODE, "okuma", born_ms + 5, seq=1)) == Origin(bd_seq, born_ms, 1)
        assert origins.of(HostEvent(EventKind.DATA, NODE, "okuma", born_ms + 100, seq=2)) == Origin(bd_seq, born_ms, 2)
        assert origins.of(HostEvent(EventKind.HOLE, NODE, "okuma", born_ms + 200)) == Origin(bd_seq, born_ms, -1)


def test_of_a_node_whose_birth_was_not_heard_the_picture_knows_the_life() -> None:
    picture = NodePicture(NODE)
    picture.bd_seq, picture.own.birth_ms = 7, 4000
    assert Origins(lambda _: picture).of(HostEvent(EventKind.DATA, NODE, "okuma", 4100, seq=3)) == Origin(7, 4000, 3)
    unheard = Origins(lambda _: None).of(HostEvent(EventKind.DEATH, NODE, "okuma", 4100))
    assert unheard == Origin(-1, 4100, -1), "the first that is heard of it stands in for its birth"
