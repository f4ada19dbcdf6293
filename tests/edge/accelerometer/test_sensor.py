"""The sensor's thread: real TCP connections, files, and senders that hang, flood, stop and talk nonsense."""

import socket
import subprocess
import sys
import threading
import time
import wave
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from pydantic import ValidationError

from edge.accelerometer import source
from edge.accelerometer.fold import BLOCK, BLOCK_METRICS, RATE, RMS, VELOCITY, Delivery
from edge.accelerometer.frame import encode
from edge.accelerometer.section import AccelerometerSection, Publish
from edge.accelerometer.sensor import HEALTH, WAITING_MAX, Accelerometer
from edge.accelerometer.source import Source, file_blocks
from edge.signals import signal
from tests.edge.accelerometer.test_fold import RATE_HZ, blocks, shaken
from tests.recordings import PROJECT

SAMPLES_G = shaken(2.6)


class Sender:
    """A sensor's box: each connection gets the next of these scripts."""

    def __init__(self, *scripts: Callable[[socket.socket], None]) -> None:
        self._scripts = list(scripts)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._listener.settimeout(0.1)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve)
        self.url = f"tcp://127.0.0.1:{self._listener.getsockname()[1]}"

    def __enter__(self) -> "Sender":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()
        self._listener.close()

    def _serve(self) -> None:
        while not self._over.is_set() and self._scripts:
            try:
                connection, _ = self._listener.accept()
            except TimeoutError:
                continue
            with connection:
                connection.settimeout(0.2)
                self._run(self._scripts.pop(0), connection)

    def _run(self, script: Callable[[socket.socket], None], connection: socket.socket) -> None:
        try:
            script(connection)
        except OSError:
            return

    def hang(self, _: socket.socket) -> None:
        """Say nothing until the end."""
        self._over.wait()


def sends(*wires: bytes) -> Callable[[socket.socket], None]:
    def script(connection: socket.socket) -> None:
        for wire in wires:
            connection.sendall(wire)

    return script


@contextmanager
def running(section: AccelerometerSection, **seams: object) -> Iterator[Accelerometer]:
    accelerometer = Accelerometer(section, **seams)  # type: ignore[arg-type]
    accelerometer.start()
    try:
        yield accelerometer
    finally:
        accelerometer.close()
    assert not [thread for thread in threading.enumerate() if thread.name == "accelerometer"]


def until(accelerometer: Accelerometer, enough: Callable[[list[Delivery]], bool]) -> list[Delivery]:
    found, deadline_s = list[Delivery](), time.monotonic() + 60.0
    while not enough(found):
        assert time.monotonic() < deadline_s, f"{found} {accelerometer.health()}"
        found += accelerometer.taken()
        time.sleep(0.01)
    return found


def values(found: list[Delivery], name: str = RMS) -> list[object]:
    return [sample.value for delivery in found for sample in delivery.frame.samples if sample.signal == name]


def test_blocks_over_tcp_become_values() -> None:
    with Sender(sends(*map(encode, blocks(SAMPLES_G)))) as sender, running(AccelerometerSection(url=sender.url)) as sensor:
        found = until(sensor, lambda found: len(values(found)) >= 2)
        assert values(found)[0] == pytest.approx(0.3, abs=0.1)
        assert [offer.signal for offer in sensor.offers()] == [RMS, VELOCITY]
        assert sensor.metrics() == ()
        assert sensor.received >= 25


def test_the_sender_that_the_docs_show_is_read_and_gives_what_they_say() -> None:
    """1 g at 100 Hz."""
    snippet = (PROJECT / "docs" / "how-to" / "vibration.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = str(listener.getsockname()[1])
    snippet = snippet.replace("9500", port).replace("range(600)", "range(26)").replace("    time.sleep(COUNT / RATE)\n", "")
    sender = subprocess.Popen([sys.executable, "-c", snippet])
    try:
        with running(AccelerometerSection(url=f"tcp://127.0.0.1:{port}")) as sensor:
            found = until(sensor, lambda found: any(isinstance(value, float) for value in values(found)))
    finally:
        sender.kill()
        sender.wait()
    rms_g = next(value for value in values(found) if isinstance(value, float))
    velocity_mm_s = next(value for value in values(found, VELOCITY) if isinstance(value, float))
    assert rms_g == pytest.approx(0.707, abs=0.001)
    assert velocity_mm_s == pytest.approx(11.04, abs=0.02)


def test_a_sender_that_breaks_off_in_a_block_is_connected_again_and_the_hole_is_counted() -> None:
    wires = [encode(block) for block in blocks(SAMPLES_G)]
    broken, whole = sends(*wires[:8], wires[8][:777]), sends(*wires[10:])
    with Sender(broken, whole) as sender, running(AccelerometerSection(url=sender.url)) as sensor:
        found = until(sensor, lambda found: any(isinstance(value, float) for value in values(found)))
        gaps = [gap for delivery in found for gap in delivery.frame.gaps]
        assert [(gap.first_sequence, gap.last_sequence, gap.lost) for gap in gaps] == [(8, 9, 2)]
        assert sensor.health()["health/accelerometer_lost_blocks"] == 2
        assert sensor.health()["health/accelerometer_blocks"] == 8 + 16
        assert int(sensor.health()["health/accelerometer_reconnects"]) >= 1
        assert "the sender closed the connection" in str(sensor.health()["health/accelerometer_last_error"])


def test_nonsense_ends_the_connection_and_not_the_thread() -> None:
    nonsense = sends(b"HTTP/1.1 400 Bad Request\r\n\r\n")
    with (
        Sender(nonsense, sends(*map(encode, blocks(SAMPLES_G)))) as sender,
        running(AccelerometerSection(url=sender.url)) as sensor,
    ):
        found = until(sensor, lambda found: len(values(found)) >= 2)
        assert None not in values(found)
        assert sensor.health()["health/accelerometer_reconnects"] == 1


def test_a_sender_that_hangs_is_closed_within_a_second() -> None:
    with Sender() as sender:
        sender._scripts.append(sender.hang)
        with running(AccelerometerSection(url=sender.url)) as sensor:
            time.sleep(0.1)
            began_s = time.monotonic()
            sensor.close()
            assert time.monotonic() - began_s < 5.0
            assert values(sensor.taken()) == []


def test_a_flood_is_slowed_down_to_twice_the_sample_rate() -> None:
    """A minute of data at once: the sender has to wait, and the edge does no more work than for two sensors."""
    wires = [encode(block) for block in blocks(SAMPLES_G[:10_000], size=2000)]

    def flood(connection: socket.socket) -> None:
        for _ in range(60):
            connection.sendall(b"".join(wires))

    began_s = time.monotonic()
    with Sender(flood) as sender, running(AccelerometerSection(url=sender.url)) as sensor:
        time.sleep(1.0)
        received = sensor.received
        assert received * 0.2 <= 2.0 + 2.0 * (time.monotonic() - began_s + 0.3) + 0.5


def test_a_loop_that_does_not_come_by_costs_blocks_that_are_counted_and_no_memory() -> None:
    section = AccelerometerSection(url="file:///none.wav", publish=Publish.BOTH)
    sensor = Accelerometer(section)
    stream = blocks(SAMPLES_G[:10_000], size=1000)
    for number in range(100):
        sensor._take(stream[number % 10]._replace(number=number))
    assert sensor.dropped >= 100 - WAITING_MAX - 10
    assert sensor.received == 100
    found = sensor.taken()
    assert len(found) <= WAITING_MAX
    sensor._take(stream[0]._replace(number=100))
    (after,) = sensor.taken()
    assert [gap.lost for gap in after.frame.gaps] == [sensor.dropped]
    assert sensor.lost == 0, "they were not lost on the way"


def test_nobody_there_is_said_and_tried_again() -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port = listener.getsockname()[1]
    with running(AccelerometerSection(url=f"tcp://127.0.0.1:{port}"), clock=lambda: time.monotonic() * 100) as sensor:
        found = until(sensor, lambda found: len(values(found)) >= 1)
        assert values(found) == [None]
        assert "refused" in str(sensor.health()["health/accelerometer_last_error"])


def written(folder: Path, name: str) -> Path:
    """The same samples in each kind of file; 16 g is full scale."""
    path = folder / name
    if name.endswith(".acb"):
        path.write_bytes(b"".join(encode(block) for block in blocks(SAMPLES_G)))
    elif name.endswith(".csv"):
        rows = "\n".join(f"{number / RATE_HZ:.4f},{value:.9f}" for number, value in enumerate(SAMPLES_G))
        path.write_text(f"t_s, acceleration_g\n{rows}\n", encoding="utf-8")
    else:
        width = {"8": 1, "16": 2, "24": 3, "32": 4}[name.removesuffix(".wav")]
        with wave.open(str(path), "wb") as file:
            file.setnchannels(2 if width == 2 else 1)
            file.setsampwidth(width)
            file.setframerate(int(RATE_HZ))
            file.writeframes(b"".join(_sample(value, width) for value in SAMPLES_G))
    return path


def _sample(value_g: float, width: int) -> bytes:
    count = round(value_g / 16.0 * 2 ** (8 * width - 1))
    if width == 1:
        return bytes([count + 128])
    sample: bytes = count.to_bytes(width, "little", signed=True)
    return sample + array("h", [123]).tobytes() if width == 2 else sample  # a second channel


@pytest.mark.parametrize(
    ("name", "resolution_g"),
    [("16.wav", 16 / 2**15), ("24.wav", 16 / 2**23), ("32.wav", 1e-8), ("8.wav", 0.125), ("a.csv", 1e-8), ("a.acb", 1e-6)],
)
def test_a_recording_is_played_from_each_kind_of_file(tmp_path: Path, name: str, resolution_g: float) -> None:
    url = f"file://{written(tmp_path, name)}"
    section = AccelerometerSection(url=url, sample_rate_hz=RATE_HZ if name == "a.csv" else 0.0, block_s=0.2)
    played = list(file_blocks(section))
    assert [block.number for block in played] == list(range(len(played)))
    assert {block.rate_hz for block in played} == {RATE_HZ}
    samples_g = [value for block in played for value in block.samples_g]
    assert samples_g == pytest.approx(SAMPLES_G, abs=resolution_g)


def test_a_file_is_played_at_its_own_pace_and_its_end_is_told(tmp_path: Path) -> None:
    waited: list[float] = []
    section = AccelerometerSection(url=f"file://{written(tmp_path, '16.wav')}", publish=Publish.BOTH)
    with running(section, wait=waited.append) as sensor:
        found = until(sensor, lambda found: "over" in str(sensor.health()["health/accelerometer_last_error"]))
        found += sensor.taken()
        assert sensor.metrics() == BLOCK_METRICS
    assert sum(waited) == pytest.approx(2.6)
    names = [change.name for delivery in found for change in delivery.changes]
    assert names.count(BLOCK) == 5
    assert names.count(RATE) == 5


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.csv", b"t,a\n1,2\n", "its first line has to name a column acceleration_g; it has 't, a'"),
        ("a.csv", b"acceleration_g\n0.1\nx\n", "a.csv: line 3: no number in column 1"),
        ("a.csv", b"1" * 9000, "a line of more than 4096 characters"),
        ("a.acb", encode(blocks(SAMPLES_G)[0])[:-1], "the last frame is not whole"),
        ("a.wav", b"RIFF", "a.wav"),
        ("none.wav", None, "No such file"),
    ],
)
def test_a_file_that_cannot_be_read_is_named_and_ends_nothing(tmp_path: Path, name: str, text: bytes | None, words: str) -> None:
    if text is not None:
        (tmp_path / name).write_bytes(text)
    source = Source(AccelerometerSection(url=f"file://{tmp_path / name}", sample_rate_hz=10_000.0))
    stream = source.blocks(lambda _: None)
    assert next(stream) is None
    assert words in source.last_error
    source.close()
    assert list(stream) == []


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"url": "http://sensor"}, "use tcp://host:port or file:"),
        ({"url": "tcp://sensor"}, "use tcp://host:port, for instance"),
        ({"url": "tcp://sensor:99999"}, "its host or port cannot be read"),
        ({"url": "file:///a.mp3"}, "the file has to be one of .wav, .csv, .acb"),
        ({"url": "file:///a.csv"}, "a CSV does not say it; set it"),
        ({"url": "tcp://s:1", "sample_rate_hz": 1000}, "is below 4000"),
        ({"url": "tcp://s:1", "publish": "all"}, "publish"),
    ],
)
def test_a_table_that_cannot_work_is_refused_before_any_io(table: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        AccelerometerSection.model_validate(table)


def test_what_it_publishes_is_canonical_or_declared() -> None:
    assert [signal(name).unit for name in (RMS, VELOCITY)] == ["g", "mm/s"]
    assert {spec.name for spec in HEALTH} == set(Accelerometer(AccelerometerSection()).health())


def test_a_sender_that_drips_bytes_that_become_no_block_is_as_silent_as_one_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "SILENCE_S_MAX", 0.5)
    wire = encode(next(iter(blocks(SAMPLES_G))))
    assert len(wire) > 400, "which take longer than the test waits"

    def drip(connection: socket.socket) -> None:
        for byte in wire[:-1]:
            connection.sendall(bytes([byte]))
            time.sleep(0.2)

    with Sender(drip, sends(*map(encode, blocks(SAMPLES_G)))) as sender, running(AccelerometerSection(url=sender.url)) as sensor:
        until(sensor, lambda found: any(isinstance(value, float) for value in values(found)))
        assert int(sensor.health()["health/accelerometer_reconnects"]) >= 1
