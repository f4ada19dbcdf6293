"""Any part is killed with -9 in the middle and started again: the end state is the same, and no session rule is broken.

Real processes, a real Mosquitto, and a proxy in between that has recorded every packet.
"""

from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

from cnctwin.standins.simulated_machine.description import SPARE_PART
from sparkplug import actions
from tests.cnctwin.plant_on_trial import Plant
from tests.sparkplug.edge_watch import EdgeWatch
from tests.wire.mqtt_packets import Connect, Disconnect, Publish
from tests.wire.proxy import Proxy

pytestmark = pytest.mark.broker
LINES_BEFORE, LINES_MISSED = 180, 12
LINES_ALL = len(SPARE_PART.read_text(encoding="utf-8").splitlines())
# State is saved every two seconds of ours, whatever the speed of the machine's clock: eighteen of its seconds pass here in one.
SAVED_WITHIN_S = 2.5
# A restarted processor has not seen the heat of the moments in between, which it counts as a hole; and a figure is published
# only when it has moved by 0.05 K, in whichever direction.
MODELLED_WITHIN = dict.fromkeys(("spindle_temp_c", "spindle_temp_rise_k", "spindle_temp_residual_k"), 0.11)
EACH_TIME_ANEW = ("_basis", "/edge_sequence", "/clock_offset_s", "/clock_offset_spread_s", "/stamp_clock")
"""An edge that was killed tells once more where it stands, and compares the clocks from the beginning."""


def run(folder: Path, killed: str | None) -> tuple[dict[str, Any], Plant]:
    with Plant(folder) as plant:
        plant.play(LINES_BEFORE)
        if killed is not None:
            plant.look(SAVED_WITHIN_S)
            plant.kill(killed)
            plant.play(LINES_MISSED)
            plant.restart(killed)
            plant.wait(lambda: all(ledger.online for ledger in plant.ledgers()), f"{killed} to be back")
        plant.play(LINES_ALL)
        plant.settle()
        values = plant.values()
        for ledger in plant.ledgers():
            assert ledger.balances, ledger
        check_sessions(plant.proxy)
        check_farewells(plant)
    return values, plant


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, mosquitto_program: str) -> dict[str, Any]:
    """The end state when nothing is killed."""
    values, _ = run(tmp_path_factory.mktemp("undisturbed"), None)
    assert values["cnc/vmc/tool_number"] == (5, "good")
    assert values["cnc/vmc/exec_state"] == ("READY", "good")
    return values


@pytest.mark.parametrize("killed", ["mosquitto", "edge", "processors"])
def test_killing_a_part_changes_nothing_in_the_end(killed: str, undisturbed: dict[str, Any], tmp_path: Path) -> None:
    values, _ = run(tmp_path, killed)
    assert values.keys() == undisturbed.keys()
    for topic, (value, quality) in undisturbed.items():
        within = MODELLED_WITHIN.get(topic.removeprefix("cnc/vmc/twin/"))
        if within is not None:
            assert values[topic][0] == pytest.approx(value, abs=within), topic
            assert values[topic][1] == quality
        elif not topic.endswith(EACH_TIME_ANEW):
            assert values[topic] == (value, quality), topic


def check_sessions(proxy: Proxy) -> None:
    """Every edge node kept the rules of seq, bdSeq, births and wills on every connection, whoever was killed."""
    watches: dict[str, EdgeWatch] = defaultdict(EdgeWatch)
    numbers: dict[str, int | None] = {}
    client_of: dict[int, str] = {}
    for recorded in proxy.recorded:
        packet = recorded.packet
        if recorded.direction != "up":
            continue
        if isinstance(packet, Connect) and packet.client_id.startswith("cnc/"):
            assert packet.will is not None and packet.clean
            client_of[recorded.connection] = packet.client_id
            will = actions.Publish(packet.will.topic, packet.will.payload, packet.will.qos, packet.will.retain)
            watch = watches[packet.client_id]
            watch.connecting(actions.Connect(will), numbers.get(packet.client_id))
            numbers[packet.client_id] = watch.will_bd_seq
        elif isinstance(packet, Publish) and packet.topic.startswith("spBv1.0/") and recorded.connection in client_of:
            watch = watches[client_of[recorded.connection]]
            watch.sent(actions.Publish(packet.topic, packet.payload, packet.qos, packet.retain), declared=[])
    assert len(watches) == 4, "the edge and three processors"


def last_packets(proxy: Proxy) -> dict[str, list[Any]]:
    """Return what each client sent last, but for those that only looked whether another process has their names."""
    last: dict[str, list[Any]] = {}
    client_of: dict[int, str] = {}
    for recorded in proxy.recorded:
        if recorded.direction == "up" and isinstance(recorded.packet, Connect):
            client_of[recorded.connection] = recorded.packet.client_id
        elif recorded.direction == "up" and isinstance(recorded.packet, Publish | Disconnect):
            last.setdefault(client_of[recorded.connection], []).append(recorded.packet)
    return {client: packets[-2:] for client, packets in last.items() if not client.startswith("host-look-")}


def check_farewells(plant: Plant) -> None:
    """Stopped in the ordinary way, each edge node and each host publishes its death, then disconnects."""
    plant.stop("edge")
    plant.stop("processors")
    ended = lambda: all(isinstance(packets[-1], Disconnect) for packets in last_packets(plant.proxy).values())  # noqa: E731
    plant.wait(ended, "every client to disconnect")
    for client, (farewell, _) in last_packets(plant.proxy).items():
        expected = "/NDEATH/" if client.startswith("cnc/") else "/STATE/"
        assert expected in farewell.topic, client
