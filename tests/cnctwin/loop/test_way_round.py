"""The loop end to end on a production machine: a meter whose 100 % is another power is found, and the gap closes, with nobody."""

from pathlib import Path

import pytest

from tests.cnctwin.loop.way_round import CLOSED_FLOORS, way_round
from tests.wire.mosquitto import Mosquitto

pytestmark = pytest.mark.broker


def test_a_meter_of_another_rated_power_is_noticed_named_and_promoted_within_a_day_and_the_gap_closes(tmp_path: Path) -> None:
    with Mosquitto(persistent=True) as broker:
        found = way_round(tmp_path / "plant", broker, "rated_power", "", {"scale": 0.5})
    assert found.noticed_h is not None and found.noticed_h <= 6.0, found
    assert ("rated_power", "") in (*found.named, *found.classes), found
    assert found.promoted_h is not None and found.promoted_h <= 16.0, found
    assert found.promotions == 1, found
    assert found.before is not None and found.before > 2.0 and found.after is not None, found
    assert found.after < CLOSED_FLOORS, found
