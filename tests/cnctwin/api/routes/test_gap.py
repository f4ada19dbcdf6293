"""The gap of a machine, its diagnosis and its report, from their folder and nowhere else."""

import json
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from cnctwin.api.routes.gap import folder_of, making
from sparkplug.quality import Quality
from tests.cnctwin.api.small_plant import THERMAL, Client, birth, client_of, reading, small_plant

DIAGNOSIS = {"verdict": "explained", "causes": [{"effect": "gravity", "on": "z"}]}
GAP = {
    "twin/gap_spindle_load_pct": 4.5,
    "twin/gap_spindle_load_pct/air": 1.25,
    "twin/gap_spindle_load_pct/mean": -0.75,
    "twin/gap_growing": True,
    "twin/gap_growing_signal": "spindle_load_pct in air: scatter has grown",
    "twin/gap_window": "2026-05-01T06:00:00Z/2026-05-01T07:00:00Z",
    "twin/gap_left_out_pct": 3.0,
    "twin/gap_basis": "learned",
}


@pytest.fixture(scope="module")
def diagnoses(tmp_path_factory: pytest.TempPathFactory) -> Path:
    outside = tmp_path_factory.mktemp("outside")
    (outside / "report.html").write_text("secret")
    (outside / "diagnosis.json").write_text('{"verdict": "secret"}')
    folder = tmp_path_factory.mktemp("diagnoses")
    (folder / "vmc").mkdir()
    (folder / "vmc" / "diagnosis.json").write_text(json.dumps(DIAGNOSIS))
    (folder / "vmc" / "report.html").write_text("<!doctype html><title>gap of vmc</title><script>1</script>")
    (folder / "broken").mkdir()
    (folder / "broken" / "diagnosis.json").write_text("{")
    (folder / "linked").symlink_to(outside)
    (folder / "linked_file").mkdir()
    (folder / "linked_file" / "report.html").symlink_to(outside / "report.html")
    return folder


@pytest.fixture(scope="module")
def client(diagnoses: Path) -> Iterator[Client]:
    live = small_plant(1_000)
    born = birth(GAP, 1_000, THERMAL)
    no_axis = reading("twin/gap_axis_a_load_pct", None, 1_000, Quality.BAD, "axis_a_load_pct is not offered")
    live.take([born._replace(readings=(*born.readings, no_axis))], 1_000)
    for machine in ("broken", "linked", "linked_file", "..", "undiagnosed"):
        live.take([birth({"spindle_rpm": 1.0}, 1_000, machine=machine)], 1_000)
    with client_of(live, diagnoses=diagnoses) as client:
        yield client


def test_the_standing_gap_is_sorted_by_signal_and_regime(client: Client) -> None:
    told = client.get("/gap/vmc").json()
    rows = [(one["signal"], one["regime"], one["gap"]["value"], one["mean"] and one["mean"]["value"]) for one in told["standing"]]
    assert rows == [("spindle_load_pct", None, 4.5, -0.75), ("spindle_load_pct", "air", 1.25, None)]
    assert told["growing"]["value"] is True
    assert told["window"] == {"from": 1777615200000, "to": 1777618800000}
    assert (told["left_out_pct"]["value"], told["basis"]) == (3.0, "learned")


def test_the_diagnosis_lies_beside_it(client: Client) -> None:
    told = client.get("/gap/vmc").json()
    assert (told["diagnosis"], told["diagnosis_reason"], told["report"]) == (DIAGNOSIS, None, "gap/vmc/report")


def test_where_there_is_none_it_says_how_to_make_one(client: Client) -> None:
    told = client.get("/gap/undiagnosed").json()
    assert (told["diagnosis"], told["report"]) == (None, None)
    assert "cnctwin gap diagnose" in told["diagnosis_reason"]
    assert told["diagnosis_do"].startswith("cnctwin gap diagnose CASE --out /") and told["diagnosis_do"].endswith("/undiagnosed")
    broken = client.get("/gap/broken").json()
    assert broken["diagnosis"] is None
    assert "cannot be read" in broken["diagnosis_reason"]


def test_the_report_is_a_page_that_can_reach_nothing(client: Client) -> None:
    report = client.get("/gap/vmc/report")
    assert report.text.startswith("<!doctype html>")
    policy = report.headers["content-security-policy"]
    assert policy.startswith("default-src 'none';")
    assert "sandbox allow-scripts" in policy
    assert "allow-same-origin" not in policy
    assert "connect-src" not in policy


@pytest.mark.parametrize(
    "machine", ["linked", "linked_file", "undiagnosed", "%2e%2e", "..%2foutside", "vmc%2f..%2fvmc", "vmc%00", ".", "%2fetc"]
)
def test_nothing_outside_the_folder_is_read(client: Client, machine: str) -> None:
    report = client.get(f"/gap/{machine}/report")
    assert report.status_code in (307, 404)
    assert "secret" not in report.text
    gap = client.get(f"/gap/{machine}")
    assert "secret" not in gap.text


@pytest.mark.parametrize("machine", ["..", ".", "", "a/b", "a\\b", "a\x00b", "../x", "/etc", "x" * 201, "a\nb"])
def test_a_name_that_is_no_folder_s_is_refused(tmp_path: Path, machine: str) -> None:
    with pytest.raises(Exception, match="name that no folder can have"):
        folder_of(tmp_path, machine)


def test_a_command_for_a_name_with_a_space_can_be_typed() -> None:
    command = making(Path("all of them"), "Fräse 1")
    assert command is not None and shlex.split(command)[-1] == "all of them/Fräse 1"


def test_without_a_folder_it_says_so() -> None:
    with client_of(small_plant()) as client:
        assert client.get("/gap/vmc").json()["diagnosis_do"] is None
        assert "--diagnoses" in client.get("/gap/vmc").json()["diagnosis_reason"]
        assert client.get("/gap/vmc/report").status_code == 404
