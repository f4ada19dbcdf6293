"""A shop for tests of the alerts fold: machines whose alarms a test sets, a clock that it turns, and what was told to whom."""

import json
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter

from processors.alerts.config import AlertsConfig
from processors.alerts.messages import COMMAND, DELIVERY, OUTBOX
from processors.alerts.processor import step
from processors.alerts.report import STATE_TOPIC
from processors.alerts.state import AlertsState
from processors.config import Configuration
from processors.contract import Output, PlainOutput, Sample, SampleKind
from processors.running.snapshot import decode_state, encode_state
from sparkplug.metric import Reading
from sparkplug.quality import Quality

T0_S = 1_795_000_000.0  # 2026-11-18T11:06:40Z, a Wednesday
VIBRATION, LOAD, SCORE, DRIFT = "twin/rule_vibration", "twin/rule_load_over_limit", "twin/anomaly_alarm", "twin/score_drift"
DESK = {"desk": {"type": "webhook", "url": "https://desk.plant.example/hook"}}
PHONE = {"phone": {"type": "webhook", "url": "https://phone.plant.example/hook"}}


@dataclass(frozen=True)
class Notification:
    """What a receiver was told, and when."""

    at_s: float
    receiver: str
    kind: str
    severity: str
    id: str
    title: str
    text: str
    says: tuple[str, ...]
    body: dict[str, Any]

    @property
    def news(self) -> list[str]:
        """Return what is new in it: firing, raised, repeat, resolved, passed."""
        return sorted(said.split(".")[2] for said in self.says if said.count(".") == 4)


class Shop:
    """See the module. `delivers`: whether a courier is there that delivers everything within the second."""

    def __init__(self, delivers: bool = True, **table: Any) -> None:
        self.configuration = Configuration(AlertsConfig, {"receivers": DESK} | table, name="alerts")
        self.state = AlertsState()
        self.wall_s = T0_S
        self.rows: dict[str, dict[str, Reading]] = {}
        self.told: list[Notification] = []
        self.retained: dict[str, bytes] = {}
        self.metrics: dict[tuple[str, str], Any] = {}
        self.fails: dict[str, str] = {}  # receiver: why
        self._delivers = delivers
        self._commands = 0

    # Machines.

    def set(self, machine: str = "okuma", *, quality: Quality = Quality.GOOD, reason: str | None = None, **values: Any) -> None:
        """Signals change; `vibration=True` is twin/rule_vibration, and so on."""
        names = {"vibration": VIBRATION, "load": LOAD, "score": SCORE, "drift": DRIFT, "severity": "twin/severity"}
        row = self.rows.setdefault(machine, {})
        changed = tuple(names.get(name, name) for name in values)
        stamp_ms = round(self.wall_s * 1000)
        row.update(
            {n: Reading(n, v, stamp_ms, quality, None, reason, False) for n, v in zip(changed, values.values(), strict=True)}
        )
        self._fold(Sample(machine, SampleKind.DATA, self.wall_s, row, changed, cell=self.rows))

    def offline(self, machine: str = "okuma") -> dict[str, Reading]:
        """The machine goes; its row, to bring it back with."""
        row = self.rows.pop(machine)
        self._fold(Sample(machine, SampleKind.DEATH, self.wall_s, row, tuple(row), cell=self.rows))
        return row

    # Time.

    def wait(self, seconds: float, beat_s: float = 1.0) -> list[Notification]:
        """Let time pass; what was told meanwhile."""
        before = len(self.told)
        end_s = self.wall_s + seconds
        while self.wall_s < end_s - 1e-6:
            self.wall_s = min(self.wall_s + beat_s, end_s)
            self.beat()
        return self.told[before:]

    def beat(self) -> None:
        """One beat at the present time."""
        self._fold(Sample("", SampleKind.BEAT, self.wall_s, {}, cell=self.rows))

    # Messages.

    def plain(self, topic: str, text: str) -> None:
        """A plain message comes."""
        self._fold(Sample("", SampleKind.PLAIN, self.wall_s, {}, detail=text, topic=topic, cell=self.rows))

    def command(self, name: str, **fields: Any) -> dict[str, Any]:
        """A command; its outcome."""
        self._commands += 1
        key = f"c{self._commands}"
        self.plain(COMMAND + name, json.dumps({"id": key, "by": "ada", **fields}))
        (outcome,) = (one for one in self.state.outcomes if one.id == key)
        return {"done": outcome.is_done, "text": outcome.text}

    def restarted(self) -> None:
        """The state goes to JSON and back, as at a restart."""
        adapter: TypeAdapter[Any] = TypeAdapter(AlertsState)
        self.state = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, self.state))))

    # What is seen.

    def alert(self, name: str = "rule_vibration", machine: str = "okuma") -> Any:
        """An alert as the state shows it; None where there is none."""
        shown = json.loads(self.retained[STATE_TOPIC])["alerts"]
        return next((a for a in shown if (a["labels"]["alertname"], a["labels"]["machine"]) == (name, machine)), None)

    def fingerprint(self, name: str = "rule_vibration", machine: str = "okuma") -> str:
        """Its fingerprint."""
        return str(self.alert(name, machine)["fingerprint"])

    def shown(self) -> dict[str, Any]:
        """The whole state as it is published."""
        return dict(json.loads(self.retained[STATE_TOPIC]))

    def _fold(self, sample: Sample) -> None:
        self.state, outputs = step(self.configuration, self.state, sample)
        for output in outputs:
            if isinstance(output, Output):
                self.metrics[output.machine or sample.machine, output.name] = output.value
            else:
                self._publish(output)

    def _publish(self, output: PlainOutput) -> None:
        if not output.payload:
            self.retained.pop(output.topic, None)
            return
        is_new = output.topic not in self.retained
        self.retained[output.topic] = output.payload
        if not output.topic.startswith(OUTBOX) or not is_new:
            return
        said = json.loads(output.payload)
        told = Notification(
            self.wall_s - T0_S,
            said["receiver"],
            said["kind"],
            said["severity"],
            said["id"],
            said["title"],
            said["text"],
            tuple(said["says"]),
            said["body"],
        )
        if self._delivers:
            self.told.append(told)
            reason = self.fails.get(told.receiver, "")
            fate = {"id": told.id, "receiver": told.receiver, "outcome": "failed" if reason else "delivered", "reason": reason}
            self.plain(DELIVERY + told.id, json.dumps(fate))
