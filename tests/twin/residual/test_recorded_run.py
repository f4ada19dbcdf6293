"""Recordings with the physics beside them: as the processor `thermal` computes it, again after a silence."""

import numpy as np
import pytest

from processors.thermal import PROCESSOR, TEMPERATURE
from tests.processors.streams import birth, data, engine_of, fed, published
from tests.twin.residual.days import PHYSICS_TOLD, recorded, samples, small_model
from twin.residual.errors import ResidualError
from twin.residual.features import AMBIENT, LOAD, MEASURED, PHYSICS, SPEED
from twin.residual.losses import losses
from twin.residual.model import save_model
from twin.residual.physics import Physics
from twin.residual.recorded_run import Samples, joined, recorded_of, recorded_run
from twin.runlog import run_log

CONSTANTS = {name: value for name, value in PHYSICS_TOLD.model_dump().items() if value is not None}


def _told(hours: float = 1.5) -> dict[str, Samples]:
    told = samples(hours)
    return {**told, MEASURED: Samples(told[SPEED].t_s, np.full(len(told[SPEED].t_s), 26.0))}


def test_the_physics_is_that_of_the_processor() -> None:
    told = _told()
    names = (SPEED, LOAD, AMBIENT, MEASURED)
    rows = [{name: float(told[name].value[place]) for name in names} for place in range(len(told[SPEED].t_s))]
    events = [birth(0.0, **rows[0]), *(data(30.0 * n, **row) for n, row in enumerate(rows[1:], 1))]
    stream = published(fed(engine_of(PROCESSOR, **CONSTANTS), *events))
    live = {at_ms / 1000: value for at_ms, name, value, _ in stream if name == TEMPERATURE and value is not None}
    found = recorded_of({name: told[name] for name in names}, PHYSICS_TOLD)
    beside = dict(zip(found.t_s.tolist(), found.signals[PHYSICS].tolist(), strict=True))
    assert len(live) > 150
    assert max(abs(beside[at_s] - value) for at_s, value in live.items() if at_s in beside) < 0.002


def test_a_silence_begins_another_stretch_from_what_is_measured_then() -> None:
    told = _told()
    quiet = {name: Samples(one.t_s + np.where(one.t_s > 1500.0, 700.0, 0.0), one.value) for name, one in told.items()}
    found = recorded_of(quiet, PHYSICS_TOLD)
    assert np.unique(found.stretch).tolist() == [0, 1]
    second = found.stretch == 1
    assert found.t_s[second][0] - found.t_s[~second][-1] > 600.0
    assert found.signals[PHYSICS][second][0] == pytest.approx(26.0, abs=0.2)


def test_where_the_drive_is_unknown_for_long_there_is_no_physics() -> None:
    told = _told()
    unknown = np.where((told[SPEED].t_s > 1000.0) & (told[SPEED].t_s < 2500.0), np.nan, told[SPEED].value)
    found = recorded_of({**told, SPEED: Samples(told[SPEED].t_s, unknown)}, PHYSICS_TOLD)
    assert not ((found.t_s > 1100.0) & (found.t_s < 2400.0)).any()
    assert np.unique(found.stretch).tolist() == [0, 1]


def test_without_an_ambient_temperature_the_configured_one_holds_or_it_is_said() -> None:
    told = {name: one for name, one in _told().items() if name != AMBIENT}
    warm = recorded_of(told, Physics(**{**PHYSICS_TOLD.model_dump(), "ambient_temp_c": 30.0}))
    assert set(warm.signals[AMBIENT].tolist()) == {30.0}
    with pytest.raises(ResidualError, match=r"there is no ambient_temp_c; configure ambient_temp_c in \[thermal\]"):
        recorded_of(told, PHYSICS_TOLD)
    with pytest.raises(ResidualError, match="there is no spindle_temp_c"):
        recorded_of({name: one for name, one in told.items() if name != MEASURED}, PHYSICS_TOLD)


def test_run_logs_that_begin_anew_are_put_one_after_the_other() -> None:
    part = recorded(20.0)
    both = joined([part, part], 3600.0)
    assert both.hours == pytest.approx(2 * part.hours)
    assert (np.diff(both.t_s) > 0.0).all()
    assert np.unique(both.stretch).tolist() == [0, 1]


def test_losses_are_of_the_corrected_in_the_region_and_of_the_physics_elsewhere(tmp_path: pytest.TempPathFactory) -> None:
    whole, done = recorded(), small_model()
    columns = {"t_s": whole.t_s, **{name: values for name, values in whole.signals.items() if name != PHYSICS}}
    columns = {f"{name[5]}_pos_mm" if name.startswith("axis_") else name: values for name, values in columns.items()}
    run = run_log(columns)
    folder = save_model(done.model, tmp_path)  # type: ignore[arg-type]
    t_s, loss = losses(folder, run)
    found = recorded_run(run, PHYSICS_TOLD, 30.0)
    alone = found.signals[MEASURED] - found.signals[PHYSICS]
    assert len(t_s) == len(loss) > 1000
    assert np.sqrt(loss.mean()) < 0.3 * np.sqrt(np.nanmean(alone**2))
