"""The agent without its web server: lines go in, observations and assets come to lie in the buffer.

Everything that changes does so under one lock, `changed`, which is also what streams wait on.
"""

import threading
from collections.abc import Callable, Iterable

from cnctwin.standins.mtconnect_agent.assets import Asset, AssetStore, read_asset
from cnctwin.standins.mtconnect_agent.buffer import ObservationBuffer
from cnctwin.standins.mtconnect_agent.device_model import DataItem, Device, DeviceModel
from cnctwin.standins.mtconnect_agent.dialect import Dialect
from cnctwin.standins.mtconnect_agent.ledger import ReplayLedger
from cnctwin.standins.mtconnect_agent.observation import Observation, observe, unavailable
from cnctwin.standins.mtconnect_agent.shdr import Command, Entry, Line, Unusable, entries
from cnctwin.standins.mtconnect_agent.stamp import microsecond_text, stamp_text


class Agent:
    """An MTConnect agent fed by one adapter. `device` is the one whose keys the lines carry; `now` gives seconds."""

    def __init__(
        self,
        model: DeviceModel,
        device: Device,
        dialect: Dialect,
        *,
        buffer_size: int,
        assets_max: int,
        now: Callable[[], float],
    ) -> None:
        self.model = model
        self.device = device
        self.dialect = dialect
        self.ledger = ReplayLedger()
        self.changed = threading.Condition(threading.RLock())
        self.is_closed = False
        self._now = now
        self._buffer_size = buffer_size
        self._assets_max = assets_max
        self._adapter_is_lost = False
        self._machine: dict[str, tuple[str, Entry]] = {}  # what the adapter would send again: key → stamp and values
        self._last_stamp = stamp_text(now())
        self.instance_id = 0
        self._begin_instance()

    def receive(self, line: Line | Command | Unusable) -> None:
        """Take in one line of the adapter."""
        with self.changed:
            self.ledger.lines += 1
            match line:
                case Command():
                    self.ledger.commands += 1
                case Unusable():
                    self.ledger.drop(line.reason)
                case Line():
                    self._last_stamp = line.stamp.text
                    self._receive_fields(line)
            self.changed.notify_all()

    def adapter_lost(self) -> None:
        """The adapter's connection broke: every item of its device is unavailable, stamped with the agent's time."""
        with self.changed:
            self._adapter_is_lost = True
            stamp = stamp_text(self._now())
            for item in self.device.items:
                if not item.is_asset_event and item.type != "ASSET_COUNT":
                    self._store(unavailable(item, stamp))
            self.changed.notify_all()

    def adapter_back(self) -> None:
        """The adapter is there again and sends what it knows, stamped with the recording's present."""
        with self.changed:
            self._adapter_is_lost = False
            self._send_snapshot()
            self.changed.notify_all()

    def restart(self) -> None:
        """Begin again: another instance id, sequence numbers from 1, an empty buffer; then the adapter connects."""
        with self.changed:
            self._begin_instance()
            if not self._adapter_is_lost:
                self._send_snapshot()
            self.changed.notify_all()

    def close(self) -> None:
        """Let every stream end."""
        with self.changed:
            self.is_closed = True
            self.changed.notify_all()

    def has_ended(self, instance_id: int) -> bool:
        """Return True if a stream that began in this instance must end: the agent stopped, or started again."""
        return self.is_closed or self.instance_id != instance_id

    @property
    def now_seconds(self) -> float:
        return self._now()

    def _begin_instance(self) -> None:
        started = self._now()
        self.instance_id = max(self.instance_id + 1, int(started))
        self.model_change_time = stamp_text(started)
        self.buffer = ObservationBuffer(self._buffer_size)
        self.assets = AssetStore(self._assets_max)
        for item in self.model.items:
            self._store(unavailable(item, stamp_text(started)))

    def _receive_fields(self, line: Line) -> None:
        if line.fields[0].startswith("@"):
            self._receive_asset(line)
            return
        stamp = self._shown_stamp(line.stamp.text)
        for entry in entries(line.fields, self._width_of):
            if not entry.values:
                self.ledger.drop("truncated")
                continue
            self._machine_knows(line.stamp.text, entry)
            if self._adapter_is_lost:
                self.ledger.drop("adapter_lost")
            else:
                self._count(self._observe(stamp, entry))

    def _observe(self, stamp: str, entry: Entry) -> str:
        """Store the entry's observation; return why not, or nothing."""
        item = self._item(entry.key)
        if item is None:
            return "unknown_key"
        if item.constant is not None:
            return "constant"
        observation = observe(item, stamp, entry.values, reads_numbers=self.dialect.is_modern)
        if observation is None:
            return "bad_level"
        return "" if self._store(observation) else "duplicate"

    def _count(self, reason: str) -> None:
        if reason:
            self.ledger.drop(reason)
        else:
            self.ledger.accept()

    def _store(self, observation: Observation) -> Observation | None:
        stored = self.buffer.add(observation)
        if stored is not None:
            self.ledger.observations += 1
        return stored

    def _machine_knows(self, stamp: str, entry: Entry) -> None:
        """Keep each known key's last values: bounded by the device model."""
        if self._item(entry.key) is not None:
            self._machine[entry.key] = (stamp, entry)

    def _send_snapshot(self) -> None:
        stamp = self._shown_stamp(self._last_stamp)
        for _, entry in self._machine.values():
            self._observe(stamp, entry)

    def _item(self, key: str) -> DataItem | None:
        item = self.device.by_key.get(key)
        if item is None and ":" in key:  # `device:key` names another device of the same adapter
            device_key, _, item_key = key.partition(":")
            device = self.model.device(device_key)
            item = device.by_key.get(item_key) if device else None
        return item

    def _width_of(self, key: str) -> int:
        item = self._item(key)
        return item.width if item else 0

    def _shown_stamp(self, text: str) -> str:
        return microsecond_text(text) if self.dialect.is_modern else text

    # Assets

    def _receive_asset(self, line: Line) -> None:
        command, *values = line.fields
        if self._adapter_is_lost:
            self.ledger.drop("adapter_lost")
            return
        stamp = self._shown_stamp(line.stamp.text)
        match command, values:
            case "@ASSET@", [asset_id, _, *body]:
                self._count(self._put_asset(asset_id, stamp, "|".join(body)))
            case "@REMOVE_ASSET@", [asset_id, *_]:
                removed = self.assets.remove(asset_id, stamp)
                self._count("" if removed else "asset_not_found")
                self._announce_removed([removed] if removed else [])
            case "@REMOVE_ALL_ASSETS@", [asset_type, *_]:
                self.ledger.accept()
                self._announce_removed(self.assets.remove_all(asset_type, self.device.uuid, stamp))
                self._announce_count(asset_type)
            case _:
                self.ledger.drop("bad_asset")

    def _put_asset(self, asset_id: str, stamp: str, body: str) -> str:
        asset = read_asset(asset_id, self.device.uuid, stamp, body)
        if asset is None:
            return "bad_asset"
        before = self.assets.get(asset.id)
        if before and not before.is_removed and before.hash == asset.hash:
            return "duplicate"
        self.assets.put(asset)
        shown = (("assetType", asset.type), ("hash", asset.hash))
        self._announce("ASSET_CHANGED", asset.id, shown if self.dialect.schema >= (2, 2) else shown[:1])
        self._announce_count(asset.type)
        return ""

    def _announce_removed(self, assets: Iterable[Asset]) -> None:
        for asset in assets:
            self._announce("ASSET_REMOVED", asset.id, (("assetType", asset.type),))
            changed = self.device.item_of_type("ASSET_CHANGED")
            latest = self.buffer.latest.of(changed) if changed else ()
            if latest and latest[0].value == asset.id:  # what was changed last is no longer there
                self._announce("ASSET_CHANGED", "UNAVAILABLE", (("assetType", asset.type),))
        for asset_type in dict.fromkeys(a.type for a in assets):
            self._announce_count(asset_type)

    def _announce(self, event: str, value: str, shown: tuple[tuple[str, str], ...]) -> None:
        item = self.device.item_of_type(event)
        if item is not None:
            self._store(Observation(item, stamp_text(self._now()), value, attributes=shown))

    def _announce_count(self, asset_type: str) -> None:
        item = self.device.item_of_type("ASSET_COUNT")
        if item is None or not asset_type:
            return
        count = self.assets.count_of(asset_type, self.device.uuid)
        known = self.buffer.latest.of(item)
        entries_now = {asset_type: str(count) if count else None}
        if count == 0 and known and known[0].entries == {}:
            return
        self._store(Observation(item, stamp_text(self._now()), "", entries=entries_now))
