"""Who may publish and read what on a broker with the files of deploy/mosquitto: every user on every topic, on the wire."""

from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path

import pytest

from processors.discovery import discover
from tests.deploy.permissions import ALL, DEVICE_VERBS, MAY_READ, MAY_WRITE, NODE_VERBS, STATES, USERS, barrier, said_by
from tests.deploy.plant import DEPLOY, EAR, EDGES, FOR_2_0, FOR_2_1, PROCESSORS, Plant, with_version
from tests.deploy.wire_client import PATIENCE_S, WireClient

pytestmark = pytest.mark.broker


def test_the_table_is_about_all_there_is() -> None:
    assert len(ALL) > 75
    assert set(MAY_WRITE) == set(MAY_READ) == set(USERS)
    assert all(allowed <= set(ALL) for allowed in (*MAY_WRITE.values(), *MAY_READ.values()))


@pytest.mark.parametrize("version", [4, 5], ids=["MQTT 3.1.1", "MQTT 5"])
@pytest.mark.parametrize("who", USERS)
def test_each_publishes_what_it_may_and_nothing_else(plant: Plant, who: str, version: int) -> None:
    with WireClient(plant.ear) as ear, WireClient(with_version(plant.of(who), version)) as client:
        ear.subscribe("#")
        sent = {topic: client.publish(topic, f"{who} was here".encode()) for topic in ALL}
        client.settle(*sent.values())
        ear.publish("over", who.encode())
        ear.hear("over", who.encode())
        got_through = {topic for topic, _ in ear.received} - {"over"}
    assert got_through == MAY_WRITE[who]
    if version == 5:
        assert {topic for topic, packet_id in sent.items() if packet_id in client.refused} == set(ALL) - MAY_WRITE[who]


@pytest.mark.parametrize("how", ["#", "topic by topic", "shared", "retained"])
@pytest.mark.parametrize("who", USERS)
def test_each_reads_what_it_may_and_nothing_else(plant: Plant, who: str, how: str) -> None:
    topics = [topic for topic in ALL if not topic.startswith("$")]  # which only the broker itself has
    with WireClient(plant.ear) as ear, WireClient(with_version(plant.of(who), 5)) as client:
        retained = how == "retained"
        if retained:
            ear.settle(*(ear.publish(topic, b"secret", retain=True) for topic in topics))
        filters = {"#": ["#"], "retained": ["#"], "shared": ["$share/all/#"], "topic by topic": topics}[how]
        client.subscribe(*filters, "spBv1.0/STATE/+")
        if not retained:
            ear.settle(*(ear.publish(topic, b"secret") for topic in topics))
        ear.settle(ear.publish("spBv1.0/STATE/over", b""))
        client.hear("spBv1.0/STATE/over", b"")
        ear.settle(*(ear.publish(topic, b"", retain=True) for topic in topics if retained))
    assert {topic for topic, payload in client.received if payload == b"secret"} == MAY_READ[who]


@pytest.mark.parametrize(("who", "topic"), list(product(("edge-other", "viewer"), (STATES[0], "spBv1.0/cnc/NDEATH/edge-okuma"))))
def test_a_will_is_no_way_around_the_rules(plant: Plant, who: str, topic: str) -> None:
    with WireClient(plant.ear) as ear:
        ear.subscribe("#")
        client = WireClient(plant.of(who), will=(topic, b'{"online":false,"timestamp":1}', True))
        client.__enter__()
        client.cut()
        allowed = WireClient(plant.of("edge-okuma"), will=("spBv1.0/cnc/NDEATH/edge-okuma", b"allowed", False))
        allowed.__enter__()
        allowed.cut()
        ear.hear("spBv1.0/cnc/NDEATH/edge-okuma", b"allowed")
        assert [said for said in ear.received if said[0] == topic] == [(topic, b"allowed")] * ("NDEATH" in topic)


@pytest.mark.parametrize("client_id", ["edge-okuma", "cnc/edge-okuma"])
@pytest.mark.parametrize("who", ["edge-other", "edge-mill", "viewer"])
def test_nobody_is_thrown_out_by_another_who_takes_the_client_id(plant: Plant, who: str, client_id: str) -> None:
    with WireClient(plant.of("edge-okuma"), client_id) as edge, WireClient(plant.of(who), client_id):
        edge.settle(edge.publish(barrier("edge-okuma"), b"1"))
        assert not edge.lost.is_set()


def test_the_name_is_that_of_the_certificate_whatever_the_client_says(plant: Plant) -> None:
    claims = replace(plant.of("edge-other"), username="edge-okuma", mqtt_version=5).with_password("x")
    with WireClient(claims) as client:
        forged, own = client.publish("spBv1.0/cnc/NDATA/edge-okuma", b""), client.publish("spBv1.0/cnc/NDATA/edge-other", b"")
        client.settle(forged, own)
        assert client.refused == {forged}


def test_the_certificate_of_an_edge_gives_no_rights_of_a_processor(plant: Plant) -> None:
    with WireClient(with_version(plant.with_certificate("edge-okuma", PROCESSORS), 5)) as client:
        sent = [client.publish(topic, b"") for topic in ALL]
        client.settle(*sent)
        assert client.refused == set(sent)
    with WireClient(with_version(plant.with_certificate("processors", EDGES), 5)) as client:
        sent = [client.publish(topic, b"") for topic in MAY_WRITE["processors"] - said_by("processors")]
        client.settle(*sent)
        assert client.refused == set(sent)


def test_each_processor_that_there_is_has_its_lines() -> None:
    lines = set((DEPLOY / "mosquitto" / "processors.acl").read_text().split("\n"))
    for name in (*discover(), "jobs"):
        node = f"twin-{name}"
        wanted = {f"topic write spBv1.0/cnc/{verb}/{node}" for verb in NODE_VERBS}
        wanted |= {f"topic write spBv1.0/cnc/{verb}/{node}/+" for verb in DEVICE_VERBS} | {f"topic write spBv1.0/STATE/{node}"}
        assert wanted <= lines, name


@pytest.mark.parametrize("path", sorted((DEPLOY / "mosquitto").glob("*.acl")), ids=lambda path: path.stem)
def test_no_rule_has_a_wildcard_where_the_verb_stands(path: Path) -> None:
    rules = [line.split(" ", 2) for line in path.read_text().split("\n") if line.startswith(("topic", "pattern"))]
    writes = [topic.split("/") for _, access, topic in rules if access != "read"]
    assert writes
    for levels in writes:
        assert levels[0] not in ("+", "#")
        assert levels[0] != "spBv1.0" or (
            (len(levels) > 3 or levels[1] == "STATE") and not set("+#") & set(levels[1] + levels[2])
        )


def test_what_is_too_large_ends_the_connection_and_is_not_lost_in_silence(plant: Plant) -> None:
    with WireClient(plant.of("edge-okuma")) as client:
        client.publish("spBv1.0/cnc/NDATA/edge-okuma", bytes(5_000_000))
        assert client.lost.wait(PATIENCE_S)


@pytest.mark.parametrize(("qos", "count"), [(0, 10_000), (1, 2000)])
def test_a_reader_that_hangs_for_a_while_loses_nothing(plant: Plant, qos: int, count: int) -> None:
    """With Mosquitto's own limits 1,000 messages are kept, and the rest is dropped in silence."""
    with WireClient(plant.of("edge-okuma")) as edge, WireClient(plant.of("viewer")) as viewer:
        viewer.subscribe("spBv1.0/cnc/#")
        viewer.pause()
        for number in range(count):
            edge.publish("spBv1.0/cnc/NDATA/edge-okuma", b"%d " % number + bytes(1000), qos=qos)
        edge.settle(edge.publish("spBv1.0/cnc/NDATA/edge-okuma", b"%d " % count))
        viewer.resume()
        viewer.until(lambda: len(viewer.received) > count, "all messages")
    assert [int(payload.split()[0]) for _, payload in viewer.received] == list(range(count + 1))


@pytest.mark.parametrize("file", [FOR_2_0, FOR_2_1])
def test_the_ear_of_the_test_is_no_part_of_what_is_shipped(file: str) -> None:
    shipped = (DEPLOY / "mosquitto" / file).read_text()
    assert "allow_anonymous true" not in shipped
    assert shipped.count("allow_anonymous false") == shipped.count("\nlistener ") == 4
    assert str(EAR) not in [line.split()[1] for line in shipped.split("\n") if line.startswith("listener ")]


def _settings(file: str) -> list[str]:
    return [line for line in (DEPLOY / "mosquitto" / file).read_text().split("\n") if line and not line.startswith("#")]


def test_the_configurations_for_2_0_and_2_1_say_the_same_and_the_newer_one_uses_nothing_deprecated() -> None:
    older, newer = _settings(FOR_2_0), _settings(FOR_2_1)
    plugins = {file: name for name, file in _plugins(newer)}
    expected = []
    for line in older[1:]:
        option, value = line.split(" ", 1)
        if option in ("acl_file", "password_file"):
            expected.append(f"plugin_use {plugins[value]}")
        elif option == "allow_anonymous":
            expected.append(f"listener_allow_anonymous {value}")
        elif option != "allow_zero_length_clientid":
            expected.append(line)
    assert older[0] == "per_listener_settings true"
    assert newer[2 * len(plugins) :] == ["allow_zero_length_clientid false", *expected]


def _plugins(settings: list[str]) -> list[tuple[str, str]]:
    """The name of each plugin and the file that it reads, one for each: listeners of one plugin would share the last file."""
    found = []
    for load, option in pairwise(settings):
        if load.startswith("plugin_load "):
            _, name, program = load.split(" ")
            assert option.split(" ")[0] == f"plugin_opt_{Path(program).stem.removeprefix('mosquitto_')}"
            found.append((name, option.split(" ")[1]))
    assert len({name for name, _ in found}) == len({file for _, file in found}) == len(found) == 5
    return found
