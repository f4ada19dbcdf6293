"""The processor `residual`: a correction beside the physics, only in the region of training, and its gain on what came since."""

import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import TypeAdapter

from processors.actions import Action, DeadLetter, Publish
from processors.config import Configuration
from processors.errors import ConfigurationError
from processors.residual import BASIS, CORRECTED, CORRECTION, GAIN, IN_REGION, LEFT, NO_MODEL, PROCESSOR, described
from processors.running.engine import Engine
from processors.running.snapshot import decode_state, encode_state
from processors.thermal import PROCESSOR as THERMAL
from sparkplug.host_session import HostEvent
from sparkplug.metric import NodeId
from tests.processors.machines import described_as
from tests.processors.streams import birth, data, engine_of, fed, hole, published, wild_stream
from tests.twin.residual.days import PHYSICS_TOLD, TICK_S, recorded, small_model
from twin.machine import Thermal
from twin.residual.features import MEASURED, PHYSICS, SIGNALS
from twin.residual.model import load_models, save_model
from twin.residual.physics import Physics

TWIN = NodeId("cnc", "twin-thermal")
HOUR = 120


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a model of the machine that the streams are of."""
    folder: Path = tmp_path_factory.mktemp("models")
    model = small_model(feature_set="remembering").model
    save_model(model, folder / "residual" / "okuma")
    (folder / "residual" / "okuma" / "current.json").write_text(json.dumps({"champion": model.version}))
    return folder


def _engine(models: Path, **table: Any) -> Engine:
    return engine_of(PROCESSOR, models=str(models), tick_s=TICK_S, **table)


def _shift(begin: int = 0, end: int = 4 * HOUR, **other: Any) -> Iterator[HostEvent]:
    """Hours of the recording that the model knows, as an edge and the processor `thermal` tell them."""
    signals = recorded().signals
    edge = [name for name in (*SIGNALS, MEASURED) if name != PHYSICS]
    for place in range(begin, end):
        at_s = place * TICK_S + 1.0
        values = {name: float(signals[name][place]) for name in edge} | other
        yield (birth if place == begin else data)(at_s, **values)
        yield (birth if place == begin else data)(at_s, node=TWIN, **{PHYSICS: float(signals[PHYSICS][place])})


def _last(actions: Sequence[Action]) -> dict[str, tuple[Any, str | None]]:
    changes = [change for action in actions if isinstance(action, Publish) for change in action.changes]
    return {change.name: (change.value, change.reason) for change in changes}


def test_without_a_model_it_runs_and_says_what_makes_one() -> None:
    actions = fed(engine_of(PROCESSOR, tick_s=TICK_S), *_shift(end=4))
    assert _last(actions) == dict.fromkeys((CORRECTION, CORRECTED, LEFT, IN_REGION, GAIN, BASIS), (None, NO_MODEL))
    assert "cnctwin train residual" in NO_MODEL


def test_a_folder_without_a_model_of_this_machine_is_no_trouble(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "not there yet"):
        assert _last(fed(_engine(folder), *_shift(end=3)))[CORRECTION] == (None, NO_MODEL)


def test_the_correction_is_what_training_would_have_said_of_that_moment(models: Path) -> None:
    table, model = small_model(feature_set="remembering").table, load_models(models)["okuma"]
    rows = dict(zip(np.searchsorted(recorded().t_s, table.t_s).tolist(), table.of(model.features), strict=True))
    stream = published(fed(_engine(models), *_shift()))
    said = {at_ms / 1000: value for at_ms, name, value, _ in stream if name == CORRECTION and value is not None}
    there = {at_s: rows[place] for at_s in said if (place := round(at_s / TICK_S) - 1) in rows}
    assert len(there) > 30
    for at_s, row in there.items():
        assert said[at_s] == pytest.approx(model.correction_one(row), abs=0.001)


def test_corrected_is_the_physics_and_the_correction_and_the_physics_own_residual_stays(models: Path) -> None:
    actions = fed(_engine(models), *_shift(end=3 * HOUR))
    last, signals = _last(actions), recorded().signals
    correction, corrected, left = (last[name][0] for name in (CORRECTION, CORRECTED, LEFT))
    physics = float(signals[PHYSICS][3 * HOUR - 2])  # what the last tick saw
    assert corrected == pytest.approx(physics + correction, abs=0.08)
    assert last[IN_REGION] == (True, None)
    assert abs(left) < 1.5
    own = {change.name for action in actions if isinstance(action, Publish) for change in action.changes}
    assert own.isdisjoint({spec.name for spec in THERMAL.outputs})
    assert {spec.name for spec in PROCESSOR.outputs}.isdisjoint({spec.name for spec in THERMAL.outputs})


def test_outside_the_region_there_is_no_correction_but_a_reason(models: Path) -> None:
    last = _last(fed(_engine(models), *_shift(end=HOUR, spindle_rpm=30_000.0)))
    value, reason = last[CORRECTION]
    assert value is None
    assert reason is not None
    assert reason.startswith("outside the region of training: spindle_rpm is about 30000, ")
    assert "trained for -1" in reason
    assert last[IN_REGION] == (False, None)
    assert last[CORRECTED] == last[LEFT] == (None, reason)


def test_a_reason_does_not_change_with_every_sample(models: Path) -> None:
    changes = [
        change.reason
        for action in fed(_engine(models), *_shift(end=2 * HOUR, spindle_rpm=30_000.0))
        if isinstance(action, Publish)
        for change in action.changes
        if change.name == CORRECTION and change.reason
    ]
    assert len(changes) <= 3


@pytest.mark.parametrize("name", ["spindle_rpm", "ambient_temp_c", "axis_x_pos_mm"])
def test_what_is_unknown_is_named(models: Path, name: str) -> None:
    last = _last(fed(_engine(models), *_shift(end=20, **{name: None})))
    assert last[CORRECTION] == (None, f"{name} is null")
    assert last[BASIS][0] is not None


def test_an_ambient_temperature_may_be_configured(models: Path) -> None:
    assert _last(fed(_engine(models, ambient_temp_c=21.0), *_shift(end=HOUR, ambient_temp_c=None)))[IN_REGION] == (True, None)


def test_the_gain_counts_what_came_since(models: Path) -> None:
    engine = _engine(models, gain_min_s=7200.0)
    early = _last(fed(engine, *_shift(end=HOUR)))
    assert early[GAIN] == (None, "less than 7200 s seen in the region yet")
    late = _last(fed(engine, *list(_shift(begin=HOUR, end=8 * HOUR))[2:]))
    assert 40.0 < late[GAIN][0] <= 100.0


def test_a_correction_that_does_harm_shows_a_loss(models: Path) -> None:
    def upside_down() -> Iterator[HostEvent]:
        signals = recorded().signals
        for place, event in enumerate(_shift(end=6 * HOUR)):
            at = place // 2
            wrong = 2.0 * signals[PHYSICS][at] - signals[MEASURED][at]
            yield (
                event
                if place % 2
                else event._replace(
                    readings=tuple(r._replace(value=float(wrong)) if r.name == MEASURED else r for r in event.readings)
                )
            )

    assert _last(fed(_engine(models), *upside_down()))[GAIN][0] < -20.0


def test_after_a_long_hole_the_means_begin_anew(models: Path) -> None:
    engine = _engine(models)
    fed(engine, *_shift(end=2 * HOUR))
    (unit,) = engine.known_units.values()
    memory = unit.live.state.memory
    fed(engine, hole(2 * HOUR * TICK_S + 1.0))  # of unknown length: short
    assert unit.live.state.memory.means == memory.means or not unit.live.state.memory.means
    later = list(_shift(begin=2 * HOUR + 40, end=2 * HOUR + 42))
    fed(engine, *later)
    rise = recorded().signals[PHYSICS][2 * HOUR + 40] - recorded().signals["ambient_temp_c"][2 * HOUR + 40]
    assert max(abs(mean - rise) for mean in unit.live.state.memory.means) < 1.0
    assert max(memory.means) - min(memory.means) > 0.5


def test_another_model_begins_its_gain_anew(models: Path) -> None:
    engine = _engine(models)
    fed(engine, *_shift(end=3 * HOUR))
    (unit,) = engine.known_units.values()
    state = unit.live.state
    assert state.gain.seconds > 3600.0
    assert state.version == PROCESSOR.configured({"models": str(models)}).read["okuma"].version
    lean = {"okuma": small_model(feature_set="lean").model}
    unit.live._config = PROCESSOR.given(Configuration(PROCESSOR.config, {"tick_s": TICK_S}, reads=lambda _: lean), "okuma")
    fed(engine, *list(_shift(begin=3 * HOUR, end=3 * HOUR + 4))[2:])
    assert unit.live.state.version == small_model(feature_set="lean").model.version
    assert unit.live.state.gain.seconds <= 4 * TICK_S


@given(cut=st.integers(0, 200), seed=st.integers(0, 1000))
@settings(max_examples=4, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_with_a_model_a_restart_in_the_middle_changes_nothing_and_nothing_crashes_it(models: Path, cut: int, seed: int) -> None:
    stream = [*_shift(end=60), *wild_stream(20, seed), *_shift(begin=70, end=100)]
    whole, restarted = _engine(models, gain_min_s=60.0), _engine(models, gain_min_s=60.0)
    expected = fed(whole, *stream[:cut])
    assert repr(fed(restarted, *stream[:cut])) == repr(expected)
    adapter: TypeAdapter[Any] = TypeAdapter(PROCESSOR.state)
    for unit in restarted.known_units.values():
        for fold in (unit.live, unit.history):
            if fold is not None:
                fold.state = decode_state(adapter, json.loads(json.dumps(encode_state(adapter, fold.state))))
    rest = fed(whole, *stream[cut:])
    assert repr(fed(restarted, *stream[cut:])) == repr(rest)
    assert not [action for action in [*expected, *rest] if isinstance(action, DeadLetter)]
    assert whole.ledger.balance == 0


def test_a_damaged_model_is_refused_at_the_start_in_one_line(tmp_path: Path) -> None:
    model = small_model().model
    folder = save_model(model, tmp_path / "okuma")
    (tmp_path / "okuma" / "current").symlink_to(folder.name, target_is_directory=True)
    (folder / "arrays.npz").write_bytes(b"no arrays")
    with pytest.raises(ConfigurationError, match="copy the model again") as refused:
        PROCESSOR.configured({"models": str(tmp_path)})
    assert "\n" not in str(refused.value)


def test_scoring_does_not_import_what_trains(models: Path) -> None:
    code = (
        "import sys; from processors.residual import PROCESSOR; light = 'numpy' in sys.modules; "
        f"PROCESSOR.configured({{'models': {str(models)!r}}}); "
        "print(light, *(name in sys.modules for name in ('sklearn', 'pyarrow', 'pandas')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert done.stdout.split() == ["False"] * 4


HEAT = {name: getattr(PHYSICS_TOLD, name) for name in Thermal.model_fields}
COOLANT = {"effect": "coolant_cooling", "parameters": {"gain": 0.4}}


def test_a_model_of_another_heat_than_the_live_description_corrects_nothing_and_says_so(models: Path) -> None:
    configuration = PROCESSOR.configured({"models": str(models)})
    model = configuration.read["okuma"]
    same, other = described_as(thermal=HEAT), described_as(COOLANT, thermal=HEAT)
    assert described(configuration, None).why_not(model) is None
    assert described(configuration, same).why_not(model) is None
    assert described(configuration, other).why_not(model) == (
        f"model {model.version} corrects constants of the configuration, the live description is {other.version}; "
        "cnctwin train residual makes one for it"
    )
    engine = engine_of(PROCESSOR, models=str(models), tick_s=TICK_S)
    shift = list(_shift(begin=0, end=10))
    fed(engine, *shift[:5])
    engine.known_units["okuma"].live._config = described(configuration, other)
    fed(engine, *shift[5:])
    unit = engine.known_units["okuma"].live
    shown = unit.emissions["okuma"].latest
    assert shown[CORRECTED].value is None
    assert shown[CORRECTED].reason == described(configuration, other).why_not(model)
    assert unit.state.version == ""


def test_a_model_keeps_the_description_that_its_physics_was() -> None:
    description = described_as(COOLANT, thermal=HEAT)
    physics = Physics.of(description.machine, description=description.version)
    assert Physics.model_validate(physics.model_dump(mode="json")) == physics
    assert physics.machine.effects == description.machine.effects
    assert not physics.is_as(PHYSICS_TOLD)
    assert PHYSICS_TOLD.is_as(Physics.of(described_as(thermal=HEAT).machine, ambient_temp_c=30.0, description="x"))
    old = {"alpha_w_per_pct_rpm2", "beta_w_per_rpm", "resistance_k_per_w", "capacity_j_per_k", "ambient_temp_c"}
    assert set(PHYSICS_TOLD.model_dump()) == old  # so that a model from before keeps its version
