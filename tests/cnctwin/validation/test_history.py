"""The nights that are kept, and when they call for retraining."""

import json
from pathlib import Path
from typing import Any

import pytest

from cnctwin.errors import UsageError
from cnctwin.validation.history import NIGHTS_MAX, file_of, kept, nights_of, retraining, validation_of

OVER, WITHIN, LITTLE, UNSEEN = "over", "within", "not enough data", "not observable"


def night(day: int, *, twin: str = "a", t: int = 0, **verdicts: str) -> dict[str, Any]:
    """A night of November 2026; verdicts by figure, as temperature_mae=…"""
    figures = []
    for name, verdict in verdicts.items():
        quantity, _, measure = name.rpartition("_")
        figures.append({"quantity": quantity, "measure": measure, "on": "", "verdict": verdict, "value": 1.0})
    return {"night": f"2026-11-{day:02d}", "t": t, "verdict": "", "twin": twin, "figures": figures}


@pytest.mark.parametrize(
    ("verdicts", "calls"),
    [
        ([OVER], None),
        ([OVER, OVER], "temperature_mae over its budget on 2026-11-01 and 2026-11-02"),
        ([OVER, WITHIN, OVER], None),
        ([OVER, WITHIN], None),
        ([OVER, OVER, WITHIN], None),
        ([OVER, LITTLE, OVER], "temperature_mae over its budget on 2026-11-01 and 2026-11-03"),
        ([OVER, UNSEEN, UNSEEN, OVER], "temperature_mae over its budget on 2026-11-01 and 2026-11-04"),
        ([OVER, LITTLE], None),
        ([LITTLE, LITTLE], None),
        ([OVER, OVER, LITTLE], "temperature_mae over its budget on 2026-11-01 and 2026-11-02"),
        ([OVER, OVER, OVER], "temperature_mae over its budget on 2026-11-02 and 2026-11-03"),
    ],
)
def test_two_nights_in_a_row_call_for_retraining_and_one_does_not(verdicts: list[str], calls: str | None) -> None:
    assert retraining([night(day, temperature_mae=one) for day, one in enumerate(verdicts, start=1)]) == calls


def test_two_bad_nights_of_two_figures_are_no_row() -> None:
    first, second = night(1, force_mape=OVER, vibration_r=WITHIN), night(2, force_mape=WITHIN, vibration_r=OVER)
    assert retraining([first, second]) is None


def test_a_twin_that_was_changed_begins_anew() -> None:
    assert retraining([night(1, force_mape=OVER), night(2, force_mape=OVER, twin="b")]) is None
    assert retraining([night(1, force_mape=OVER), *(night(n, force_mape=OVER, twin="b") for n in (2, 3))]) is not None


def test_a_night_that_is_judged_again_takes_the_place_it_had(tmp_path: Path) -> None:
    for day, verdict in ((1, OVER), (3, OVER), (2, WITHIN), (3, WITHIN)):
        kept(night(day, force_mape=verdict), "vmc", tmp_path)
    nights = nights_of("vmc", tmp_path)
    assert [one["night"][-2:] for one in nights] == ["01", "02", "03"]
    assert nights[-1]["figures"][0]["verdict"] == WITHIN


def test_the_file_is_bounded_and_a_torn_line_is_passed_over(tmp_path: Path) -> None:
    lines = [json.dumps({"night": f"{n:06d}", "figures": []}) for n in range(NIGHTS_MAX + 50)]
    path = file_of("vmc", tmp_path)
    path.write_text("\n".join([*lines, '{"night": "torn', "[]", '{"night": 5}', "null"]) + "\n")
    nights = kept(night(1, force_mape=OVER), "vmc", tmp_path)
    assert NIGHTS_MAX - 5 < len(nights) <= NIGHTS_MAX and nights[-1]["night"] == "2026-11-01"
    assert len(path.read_text().splitlines()) == len(nights)
    assert [one.name for one in tmp_path.iterdir()] == ["vmc.jsonl"]


@pytest.mark.parametrize("machine", ["../../etc/passwd", "a/b", ".hidden", "ü ß", "x%2F"])
def test_a_machine_may_be_called_anything(machine: str, tmp_path: Path) -> None:
    kept(night(1, force_mape=OVER), machine, tmp_path / "nights")
    assert len(nights_of(machine, tmp_path / "nights")) == 1
    assert file_of(machine, tmp_path / "nights").parent == tmp_path / "nights"
    assert [one.name for one in tmp_path.iterdir()] == ["nights"]


def test_what_is_told_of_a_machine(tmp_path: Path) -> None:
    assert validation_of("vmc", tmp_path) == {
        "machine": "vmc", "t": None, "verdict": None, "figures": [], "nights": [],
        "retrain": False, "retrain_reason": None, "over_in_a_row": {},
    }  # fmt: skip
    for day in (1, 2, 3):
        kept(night(day, t=1000 * day, force_mape=OVER), "vmc", tmp_path)
    told = validation_of("vmc", tmp_path, nights=2)
    assert told["t"] == 3000 and len(told["nights"]) == 2 and told["retrain"] is True
    assert told["over_in_a_row"] == {"force_mape": 3}


def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="cannot be"):
        kept(night(1, force_mape=OVER), "vmc", tmp_path / "file")
