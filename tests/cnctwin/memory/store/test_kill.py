"""kill -9 at any moment: what was acknowledged is there, once."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from cnctwin.memory.store.contract import Query
from cnctwin.memory.store.embedded import EmbeddedStore
from tests.cnctwin.memory.store.told import HOUR_MS, T0_MS, steady
from tests.cnctwin.memory.store.writes_until_killed import EVERY_MS

KILLS = 20


def test_a_writer_killed_again_and_again_loses_nothing_and_has_nothing_twice(tmp_path: Path) -> None:
    chance, said = random.Random(7), 0
    command = [sys.executable, "-m", "tests.cnctwin.memory.store.writes_until_killed", str(tmp_path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        for _ in range(KILLS):
            process.stdin.write(f"{said}\n")
            process.stdin.flush()
            child, batches = 0, chance.randrange(1, 4)
            for line in process.stdout:
                if line.startswith("process"):
                    child = int(line.split()[1])
                elif line == "ended\n":
                    break
                else:
                    said = int(line)
                    batches -= 1
                    if child and batches <= 0:
                        time.sleep(chance.uniform(0.0, 0.08))
                        os.kill(child, signal.SIGKILL)
                        child = 0
        process.stdin.close()
    store = EmbeddedStore(tmp_path, writable=True)
    named = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*.parquet*")}
    with store._readers.snapshot() as db:
        assert named == {name for (name,) in db.execute("SELECT name FROM files WHERE state = 0")}
    [column] = store.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 5000 * HOUR_MS))
    assert len(named) > 2, "nothing was sealed: this test would not see a kill while it is"
    assert len(column.t_us) >= said
    assert column.t_us == [(T0_MS + n * EVERY_MS) * 1000 for n in range(len(column.t_us))]
    wanted = steady(0, len(column.t_us), every_ms=EVERY_MS)
    assert column.value == [m.event.readings[0].value for m in wanted]
    assert [m[:2] for m in store.messages("vmc", 0, T0_MS + 5000 * HOUR_MS)] == [m[:2] for m in wanted]
    assert store.status().samples == 3 * len(wanted)
    store.close()


class Killed(BaseException):
    """The process ends here."""


@pytest.mark.parametrize("at", ["before the file is there", "when it is there, before the commit", "after the commit"])
def test_a_kill_while_an_hour_is_sealed(tmp_path: Path, at: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cnctwin.memory.store.sealed.sealing.SAMPLES_MIN", 1)
    store = EmbeddedStore(tmp_path, writable=True)
    messages = steady(0, 700, every_ms=5000)
    store.append(messages)
    writer = store._writer

    def die(*_: object) -> None:
        raise Killed

    with monkeypatch.context() as patched:
        if at == "before the file is there":
            patched.setattr(Path, "replace", die)
        elif at == "when it is there, before the commit":
            patched.setattr("cnctwin.memory.store.sealed.sealing.Sealer._remove", die)
        else:
            patched.setattr("cnctwin.memory.store.sealed.tier.SealedTier._remove", die)
        with pytest.raises(Killed):
            store.tidy(T0_MS + HOUR_MS + 600_000)
    writer._lock._file.close()  # as the kernel does
    writer.db.close()
    again = EmbeddedStore(tmp_path, writable=True)
    [column] = again.query(Query("vmc", ("x_mm",), T0_MS, T0_MS + 5 * HOUR_MS))
    assert column.value == [m.event.readings[0].value for m in messages]
    assert [m[:2] for m in again.messages("vmc", 0, T0_MS + 5 * HOUR_MS)] == [m[:2] for m in messages]
    again.tidy(T0_MS + 2 * HOUR_MS + 600_000)
    assert len([p for p in tmp_path.rglob("*.parquet*") if p.is_file()]) == 1
    again.close()
    store.close()
