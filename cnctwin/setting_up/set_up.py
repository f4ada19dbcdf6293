"""The set-up of a plant's folder: what is asked, what is tried, and the files that come of it.

An answer that an option gives is not asked for; what is there already is the default, and stays where the answer is the same.
"""

import os
import shlex
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from cnctwin.errors import UsageError
from cnctwin.machines.disk import text_of
from cnctwin.machines.starters import machine_classes, starter_text, title_of
from cnctwin.processes.given_broker import BROKER_VARIABLE, PASSWORD_VARIABLE
from cnctwin.running.plant_folder import PlantFolder, variables, with_variables
from cnctwin.setting_up import receiver
from cnctwin.setting_up.alert_trial import send_test
from cnctwin.setting_up.broker_trial import try_broker
from cnctwin.setting_up.control_trial import address_of, at_another_address, drafted, first_values, in_words
from cnctwin.setting_up.dialog import Dialog
from cnctwin.setting_up.planned_files import PlannedFile
from cnctwin.setting_up.toml_text import with_key
from edge.state_dir import VARIABLE as STATE_VARIABLE
from sparkplug.broker import BrokerAddress
from sparkplug.errors import BrokerAddressError, TopicError
from sparkplug.topics import check_id

T = TypeVar("T")
NONE, PRIVATE, KEEP = "none", "private", "keep"
USUAL_CLASS = "vmc-40"
PROCESSORS = """\
# How the processors of this plant run: a table for each. What does not stand here has its default (docs/reference/processors.md).

[historian]
raw_days = 365.0

[alerts]
# Receivers of notifications stand below, one table for each (docs/how-to/alerts.md); their secrets in secrets/plant.env.

[loop]
# A gap that grows is diagnosed by itself; its answer waits until a person promotes it (docs/how-to/loop.md).
diagnose = "by_itself"
promote = "by_hand"
"""
ADDRESSES = "# Addresses that `cnctwin up` runs with. Empty: a private broker on this computer. No secret stands here.\n"
SECRETS = "# Passwords and tokens that `cnctwin up` runs with. Its owner alone may read this file (mode 600).\n"
UNIT = """\
# cnctwin, as `cnctwin init` has set it up. As a service of this user, which goes on after logging out:
#   systemctl --user link {unit} && systemctl --user enable --now cnctwin && loginctl enable-linger
[Unit]
Description=cnctwin in {root}

[Service]
ExecStart={command}
Restart=always
RestartSec=5
TimeoutStopSec=60
UMask=0077

[Install]
WantedBy=default.target
"""


@dataclass(frozen=True, slots=True)
class Answers:
    """The answers that the command line gives; None = it is asked for."""

    control: str | None = None
    device: str = ""
    machine: str | None = None
    broker: str | None = None
    alerts: str | None = None
    machine_class: str | None = None
    service: bool = True


@dataclass(slots=True)
class SetUp:
    """One set-up. environment: where secrets may stand that nobody has to type."""

    folder: PlantFolder
    answers: Answers
    dialog: Dialog
    environment: Mapping[str, str] = field(default_factory=lambda: os.environ)
    texts: dict[Path, str] = field(default_factory=dict)

    def files(self) -> list[PlannedFile]:
        """Ask, try, and return the files that come of it. Raises UsageError; nothing is written."""
        machine = self._control()
        self._broker()
        self._alerts()
        self._class(machine)
        if self.answers.service and text_of(self.folder.unit) is None:
            command = f"{shlex.join([sys.executable, '-m', 'cnctwin', 'up'])} {shlex.quote(str(self.folder.root))}"
            self.texts[self.folder.unit] = UNIT.format(unit=self.folder.unit, root=self.folder.root, command=command)
        secret = self.folder.secrets
        return [PlannedFile(path, text, text_of(path), path == secret) for path, text in self.texts.items()]

    def _control(self) -> str:
        """The control, its edge's file, and the name of the machine."""
        there = sorted(self.folder.edges.glob("*.toml"))
        known = there[0].stem if len(there) == 1 else None
        machine = known if self.answers.machine is None else _checked_name(self.answers.machine)
        file = None if machine is None else self.folder.edges / f"{machine}.toml"
        before = None if file is None else text_of(file)
        now = NONE if before is None or file is None else address_of(before, file)
        question = "Address of the control (http://agent:5000, focas://host, opc.tcp://host:4840, lsv2://host, or none)"
        asked = question if before is None else f"Address of the control of {machine}"
        draft = self._answered(asked, now, "--control", self.answers.control, lambda url: self._drafted(url, now, before))
        if draft is None:
            return machine or self._named("machine")
        if machine is None:
            machine = self._named(str(_name_in(draft)))
        file = self.folder.edges / f"{machine}.toml"
        before = text_of(file)
        text = draft if before is None else at_another_address(before, draft, file)
        self.texts[file] = with_key(text, "machine", "name", machine, file)
        return machine

    def _drafted(self, url: str, now: str, before: str | None) -> str | None:
        """The draft for a control, its first values shown; None where there is none."""
        if url == NONE:
            return None
        if url.startswith("opc.tcp://"):  # the certificates that are exchanged are kept where `cnctwin up` looks for them
            os.environ[STATE_VARIABLE] = str(self.folder.state)
        kept = before if url == now else None
        draft = kept or drafted(url, self.answers.device)
        try:
            rows = first_values(draft)
        except UsageError as error:
            if kept is None:
                raise
            self.dialog.tell(f"{url} stays, though it does not answer now: {error}")
            return kept
        for line in in_words(rows):
            self.dialog.tell(line)
        return draft

    def _named(self, default: str) -> str:
        return self._answered("Name of the machine", default, "--machine", None, _checked_name)

    def _broker(self) -> None:
        """The broker, which is tried, and its password."""
        file = self.folder.addresses
        before = text_of(file)
        now = variables(file).get(BROKER_VARIABLE, "") or PRIVATE
        url, password = self._answered(
            "Broker (mqtt://[user@]host, or private: one of our own on this computer)",
            now,
            "--broker",
            self.answers.broker,
            self._tried,
        )
        given = "" if url == PRIVATE else url
        self.texts[file] = with_variables(before or ADDRESSES, {BROKER_VARIABLE: given})
        if password is not None:
            self._keep({PASSWORD_VARIABLE: password})
        edges = self.folder.edges
        named = {path for path in self.texts if path.parent == edges} | (set() if url == now else set(edges.glob("*.toml")))
        for edge in sorted(named) if given else ():
            text = with_key(self.texts.get(edge) or text_of(edge) or "", "broker", "url", given, edge)
            has_user = BrokerAddress.from_url(given).username is not None
            self.texts[edge] = with_key(text, "broker", "password_env", PASSWORD_VARIABLE, edge) if has_user else text

    def _tried(self, url: str) -> tuple[str, str | None]:
        """An address that was tried, with the password of its user."""
        is_kept = self.answers.broker is None and url == variables(self.folder.addresses).get(BROKER_VARIABLE)
        if url == PRIVATE or is_kept:
            return url, None
        try:
            broker = BrokerAddress.from_url(url)
        except BrokerAddressError as error:
            raise UsageError(str(error)) from None
        password = None
        if broker.username is not None:
            kept = variables(self.folder.secrets).get(PASSWORD_VARIABLE)
            there = self.environment.get(PASSWORD_VARIABLE) or kept
            password = there or self.dialog.secret(f"Password of {broker.username} on the broker", PASSWORD_VARIABLE)
        try_broker(broker.with_password(password))
        self.dialog.tell(f"{broker.url}: connected")
        return url, password

    def _alerts(self) -> None:
        """The receiver of alerts, to which a test is sent."""
        file = self.folder.processors
        before = text_of(file)
        text = before or PROCESSORS
        now = KEEP if f"[alerts.receivers.{receiver.NAME}]" in text else NONE
        question = "Alerts go to (pushover, https://…, http://localhost…, an address of Apprise such as mailto://…, or none)"
        self.texts[file] = self._answered(
            question, now, "--alerts", self.answers.alerts, lambda answer: self._receiving(text, answer)
        )

    def _receiving(self, text: str, answer: str) -> str:
        """The configuration with the receiver that was answered, once the test has arrived."""
        file = self.folder.processors
        if answer == KEEP:
            return text
        if answer == NONE:
            return receiver.without_receiver(text, file)
        kind = receiver.kind_of(answer)
        names = (receiver.TOKEN, receiver.USER) if kind == receiver.PUSHOVER else ()
        secrets = {name: self.environment.get(name) or self.dialog.secret(name, name) for name in names}
        secrets = secrets or {receiver.ADDRESS: answer}
        changed = receiver.with_receiver(text, kind, file)
        send_test(changed, receiver.NAME, secrets)
        self.dialog.tell("a test was sent and taken")
        self._keep(secrets)
        return changed

    def _class(self, machine: str) -> None:
        """The description of the machine: a starter of its class, where there is none yet or another one is asked for."""
        file = self.folder.machines / f"{machine}.toml"
        there = text_of(file) is not None
        if there and self.answers.machine_class is None:
            self.dialog.tell(f"{file.relative_to(self.folder.root)} stays as it is; --class replaces it")
            return
        for one in machine_classes() if self.answers.machine_class is None else ():
            self.dialog.tell(f"  {one:<10} {title_of(one)}")
        self.texts[file] = self._answered(
            "Class of the machine", USUAL_CLASS, "--class", self.answers.machine_class, lambda one: starter_text(one, machine)
        )

    def _keep(self, values: Mapping[str, str]) -> None:
        file = self.folder.secrets
        before = self.texts.get(file) or text_of(file) or SECRETS
        if broken := [name for name, value in values.items() if "\n" in value or not value]:
            raise UsageError(f"{broken[0]} is empty, or has more than one line")
        self.texts[file] = with_variables(before, values)

    def _answered(self, question: str, default: str, option: str, given: str | None, tried: Callable[[str], T]) -> T:
        """Return what comes of an answer. One that does not work may be given again, by a person."""
        while True:
            answer = given if given is not None else self.dialog.ask(question, default, option)
            try:
                return tried(answer)
            except UsageError as error:
                if given is not None or not self.dialog.is_patient:
                    raise
                self.dialog.tell(f"  {error}")


def _checked_name(name: str) -> str:
    """Return the name of a machine, which can be one of a Sparkplug device and of a file. Raises UsageError."""
    try:
        return check_id(name, "machine name")
    except TopicError as error:
        raise UsageError(f"{error}; give another one with --machine") from None


def _name_in(draft: str) -> str:
    """The machine's name in a draft, in small letters, as it becomes the name of a file."""
    name = next((line.partition("=")[2] for line in draft.splitlines() if line.startswith("name =")), "machine")
    return name.strip().strip('"').lower()
