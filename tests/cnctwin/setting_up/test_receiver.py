"""The receiver of alerts that an answer names is one that the processor takes, and holds no secret."""

import tomllib
from pathlib import Path

import pytest

from cnctwin.errors import UsageError
from cnctwin.setting_up.receiver import kind_of, with_receiver, without_receiver
from cnctwin.setting_up.set_up import PROCESSORS
from processors.alerts.config import AlertsConfig
from processors.alerts.processor import PROCESSOR

FILE = Path("processors.toml")


def receivers(text: str) -> dict[str, object]:
    """Return the receivers of a configuration, as the processor has read them."""
    configured = PROCESSOR.configured(tomllib.loads(text)["alerts"]).default
    assert isinstance(configured, AlertsConfig)
    return {name: receiver.model_dump(exclude_unset=True) for name, receiver in configured.receivers.items()}


@pytest.mark.parametrize(
    ("answer", "found"),
    [
        ("pushover", {"type": "pushover", "token": "$PUSHOVER_TOKEN", "user": "$PUSHOVER_USER"}),
        ("https://hooks.plant.example/T0/abc", {"type": "webhook", "url": "$CNCTWIN_ALERTS_URL"}),
        ("http://localhost:9000/cnctwin", {"type": "webhook", "url": "$CNCTWIN_ALERTS_URL"}),
        ("mailto://ada:s3cret@plant.example", {"type": "apprise", "url": "$CNCTWIN_ALERTS_URL"}),
    ],
)
def test_each_kind_is_taken_by_the_processor(answer: str, found: dict[str, str]) -> None:
    text = with_receiver(PROCESSORS, kind_of(answer), FILE)
    assert receivers(text) == {"operators": found}
    assert answer.partition("://")[2] == "" or answer.partition("://")[2] not in text


def test_another_kind_takes_its_place_and_the_same_kind_keeps_what_a_person_added() -> None:
    text = with_receiver(PROCESSORS, "webhook", FILE) + 'language = "de"\n'
    assert with_receiver(text, "webhook", FILE) == text
    assert receivers(with_receiver(text, "pushover", FILE)) == receivers(with_receiver(PROCESSORS, "pushover", FILE))


def test_it_goes_and_leaves_the_file_as_it_was() -> None:
    assert without_receiver(with_receiver(PROCESSORS, "apprise", FILE), FILE) == PROCESSORS


@pytest.mark.parametrize("answer", ["", "ada", "://hooks"])
def test_an_answer_that_names_nobody_is_refused(answer: str) -> None:
    with pytest.raises(
        UsageError, match=r"alerts go to pushover, to an https:// address .or http:// on this computer., to an address of Apprise"
    ):
        kind_of(answer)
