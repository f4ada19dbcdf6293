"""An inbox that cannot be read in time: when it is thinned, and of what."""

from collections import Counter

from sparkplug.admission.rates import Overrun
from sparkplug.admission.thinning import Lateness, thinned
from sparkplug.metric import NodeId

FLOOD, QUIET = NodeId("cnc", "edge-flood"), NodeId("cnc", "edge-quiet")
Message = tuple[str | object, bytes, float]


def message(node: NodeId, number: int, verb: str = "DDATA") -> Message:
    return f"spBv1.0/{node.group}/{verb}/{node.node}/mill", str(number).encode(), float(number)


def none(_: NodeId) -> bool:
    return False


def test_a_delay_of_a_moment_thins_nothing_and_one_that_lasts_does_now_and_then() -> None:
    lateness = Lateness()
    assert not any(lateness.is_lasting(3.0, now_s) for now_s in (0.0, 0.2, 0.4))
    assert not lateness.is_lasting(0.1, 0.45)
    told = [lateness.is_lasting(1.0, tenth / 10) for tenth in range(5, 31)]
    assert told == [False] * 15 + [True, False, False] * 3 + [True, False]


def test_the_node_with_most_data_loses_the_older_half_and_nobody_else_loses_anything() -> None:
    mark = object()
    waiting: list[Message] = [message(FLOOD, -1, "DBIRTH"), (mark, b"", 0.0)]
    for number in range(1000):
        waiting.append(message(FLOOD, number))
        if number % 20 == 0:
            waiting.append(message(QUIET, number))
    stays, gone = thinned(waiting, none)
    assert gone == Counter({(FLOOD, True): 500})
    assert [one for one in stays if one in waiting and one[0] != message(FLOOD, 0)[0]] == [
        one for one in waiting if one[0] != message(FLOOD, 0)[0]
    ]
    of_flood = [one for one in stays if one[0] == message(FLOOD, 0)[0]]
    assert of_flood == [message(FLOOD, number) for number in range(500, 1000)]
    place = stays.index(message(FLOOD, 500))
    assert stays[place - 1][0] == Overrun(FLOOD, False)
    assert sum(isinstance(one[0], Overrun) for one in stays) == 1


def test_few_messages_and_those_of_trusted_nodes_are_let_be() -> None:
    waiting: list[Message] = [message(FLOOD, number) for number in range(99)]
    assert thinned(waiting, none) == (waiting, Counter())
    many: list[Message] = [message(FLOOD, number) for number in range(1000)]
    assert thinned(many, lambda node: node == FLOOD) == (many, Counter())
    plain: list[Message] = [("cnc/DATA/x", b"", 0.0), ("spBv1.0/x/DDATA/", b"", 0.0)] * 500
    assert thinned(plain, none) == (plain, Counter())
