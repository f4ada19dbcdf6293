"""Every Sparkplug message that the demo publishes is decoded by another implementation, the npm package sparkplug-payload."""

import re
import subprocess
import sys
import time
from collections import Counter

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from sparkplug.topics import Topic
from tests.peers.npm_peer import NodeProcess, installed_peers
from tests.wire.mosquitto import free_port

pytestmark = [pytest.mark.broker, pytest.mark.node]


def recorded_demo(port: int) -> tuple[list[tuple[str, bytes]], str]:
    """All messages of a short demo, and what it said at the end."""
    command = [sys.executable, "-m", "cnctwin", "demo", "--port", str(port), "--speed", "20", "--seconds", "16", "--no-open"]
    messages: list[tuple[str, bytes]] = []
    client = paho.Client(CallbackAPIVersion.VERSION2, "recorder")
    client.on_message = lambda _c, _u, message: messages.append((message.topic, bytes(message.payload)))
    client.on_connect = lambda c, *_: c.subscribe("spBv1.0/#")
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as demo:
        deadline_s = time.monotonic() + 60.0
        while time.monotonic() < deadline_s:
            try:
                client.connect("127.0.0.1", port)
                break
            except OSError:
                time.sleep(0.05)
        client.loop_start()
        said, _ = demo.communicate(timeout=300)
        client.loop_stop()
        client.disconnect()
    assert demo.returncode == 0, said
    return messages, said


def test_sparkplug_payload_decodes_every_message_of_the_demo(mosquitto_program: str) -> None:
    installed_peers()
    messages, said = recorded_demo(free_port())
    changes = re.search(r"(\d+) tool changes", said)
    assert changes is not None and int(changes[1]) >= 4, said  # five a part, which takes five seconds at this speed
    verbs: Counter[str] = Counter()
    with NodeProcess("decode.mjs") as peer:
        for topic, payload in messages:
            if "/STATE/" in topic:
                continue
            answer = peer.ask(payload.hex())
            assert "payload" in answer, (topic, answer)
            verbs[Topic.parse(topic).verb] += 1
    assert verbs["NBIRTH"] >= 4 and verbs["DBIRTH"] >= 3 and verbs["DDATA"] > 300 and verbs["NDATA"] > 10, verbs
