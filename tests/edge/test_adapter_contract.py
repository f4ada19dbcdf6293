"""What holds for every adapter. An adapter that is added is found and gets these tests with its folder of recorded frames.

`frames/<adapter>/` holds frames in the order of their names, and `expected.json`: for each frame the samples and gaps that it
gives. To write that file for new frames: `CNCTWIN_WRITE_EXPECTED=1 python -m pytest tests/edge/test_adapter_contract.py`; then
read it before you keep it.
"""

import json
import os
import tomllib
from collections.abc import Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from edge.adapter import Adapter, adapters, modules
from edge.chosen import Chosen
from edge.config import EdgeConfig, MachineSection
from edge.config_file import load
from edge.errors import ConfigError
from edge.running.pipeline import Pipeline
from edge.sample import EdgeSample, SampleSet
from edge.section import Section
from edge.signals import signal
from edge.tool_change import not_observable
from sparkplug.quality import Quality

FRAMES = Path(__file__).with_name("frames")
ROOT = Path(__file__).parents[2]
SHARED = ROOT / "edge" / "edge.toml"
every_adapter = pytest.mark.parametrize("adapter", adapters().values(), ids=lambda adapter: adapter.name)


def frames_of(adapter: Adapter) -> list[Path]:
    frames = sorted(path for path in (FRAMES / adapter.name).glob("*") if path.name != "expected.json")
    assert frames, f"an adapter needs recorded frames in tests/edge/frames/{adapter.name}/"
    return frames


def config_of(adapter: Adapter) -> EdgeConfig[Any]:
    return EdgeConfig(source=adapter.config_model())


def played(adapter: Adapter, frames: Sequence[bytes]) -> list[tuple[Any, SampleSet]]:
    """The cursor and what was given, after each frame."""
    config, steps = config_of(adapter), list[tuple[Any, SampleSet]]()
    cursor = adapter.start(config)
    for raw in frames:
        cursor, given_ = adapter.parse(config, cursor, raw)
        steps.append((cursor, given_))
    return steps


def plain(given_: SampleSet) -> dict[str, object]:
    """Return what a frame gave, as JSON."""
    samples = [[s.signal, s.value, s.timestamp_ms, s.quality.name, s.reason] for s in given_.samples]
    gaps = [[gap.reason, gap.first_sequence, gap.last_sequence, gap.lost] for gap in given_.gaps]
    return {"samples": samples, "gaps": gaps, "dropped": {str(k): n for k, n in given_.dropped.items()}, "error": given_.error}


@every_adapter
def test_it_is_found_by_the_name_of_its_file(adapter: Adapter) -> None:
    declaration = ROOT / f"{modules()[adapter.name].replace('.', '/')}.py"
    assert declaration.read_text(encoding="utf-8").count("\nADAPTER = Adapter(") == 1
    assert frames_of(adapter)


@every_adapter
def test_its_sample_configuration_loads_and_every_section_holds_the_defaults(adapter: Adapter) -> None:
    machine, default = MachineSection(adapter=adapter.name), EdgeConfig(source=adapter.config_model())
    assert load(adapter.sample_config) == replace(default, machine=machine, path=adapter.sample_config)
    assert load(SHARED) == replace(default, source=adapters()[MachineSection().adapter].config_model(), path=SHARED)


@every_adapter
def test_its_sample_and_the_shared_one_name_every_key_once(adapter: Adapter) -> None:
    own = adapter.sample_config.read_text(encoding="utf-8")
    config = load(adapter.sample_config)
    keys = {"machine": config.machine, adapter.name: config.source}
    assert tomllib.loads(own).keys() == keys.keys(), "what all edges share is in edge/edge.toml"
    shared = {one.name: getattr(config, one.name) for one in fields(config) if isinstance(getattr(config, one.name), Section)}
    shared = {name: section for name, section in shared.items() if name not in {"machine", "source"}}
    of_all = tomllib.loads(SHARED.read_text(encoding="utf-8"))
    assert (of_all.pop("variables"), of_all.pop("plc")) == ({}, {}), "what is read by address is each machine's own"
    assert of_all.keys() == shared.keys(), "what one control has is in its own sample"
    tables = tomllib.loads(own) | of_all
    for name, section in (keys | shared).items():
        assert tables[name].keys() == type(section).model_fields.keys()


@every_adapter
@pytest.mark.parametrize("is_plc", [False, True])
def test_an_address_that_is_none_is_refused_in_one_line(adapter: Adapter, is_plc: bool) -> None:
    with pytest.raises(ConfigError) as caught:
        adapter.address(Chosen("plc_x" if is_plc else "variable_x", "no place [ at all", is_plc=is_plc))
    assert "\n" not in str(caught.value)


@every_adapter
def test_its_sample_its_page_and_its_code_lead_to_each_other(adapter: Adapter) -> None:
    declaration = f"{modules()[adapter.name].replace('.', '/')}.py"
    sample, shared = adapter.sample_config.relative_to(ROOT).as_posix(), SHARED.relative_to(ROOT).as_posix()
    page = f"docs/how-to/edge-{adapter.name.replace('_', '-')}.md"
    for file, others in (
        (sample, (page, declaration, shared)),
        (declaration, (page, adapter.sample_config.name, shared)),
        (page, (f"(../../{sample})", f"(../../{declaration})", f"(../../{shared})")),
        ("docs/how-to/edges.md", (f"({Path(page).name})", f"(../../{sample})", f"(../../{shared})")),
    ):
        text = (ROOT / file).read_text(encoding="utf-8")
        assert [other for other in others if other not in text] == [], file


@every_adapter
def test_each_recorded_frame_gives_its_expected_samples(adapter: Adapter) -> None:
    frames = frames_of(adapter)
    found = {
        path.name: plain(given_)
        for path, (_, given_) in zip(frames, played(adapter, [p.read_bytes() for p in frames]), strict=True)
    }
    file = FRAMES / adapter.name / "expected.json"
    if os.environ.get("CNCTWIN_WRITE_EXPECTED"):
        text = ",\n".join(f" {json.dumps(name)}: {json.dumps(one, ensure_ascii=False)}" for name, one in found.items())
        file.write_text("{\n" + text + "\n}\n", encoding="utf-8")
    assert file.exists(), f"CNCTWIN_WRITE_EXPECTED=1 writes {file.name} from what the frames give; read it before you keep it"
    assert found == json.loads(file.read_text(encoding="utf-8"))
    assert any(one["gaps"] for one in found.values()), "one of the recorded holes must become a gap"


@every_adapter
def test_each_observation_is_a_sample_or_a_counted_drop(adapter: Adapter) -> None:
    for _, given_ in played(adapter, [path.read_bytes() for path in frames_of(adapter)]):
        assert given_.accounted()


@every_adapter
def test_samples_are_canonical_and_a_null_has_a_reason(adapter: Adapter) -> None:
    for _, given_ in played(adapter, [path.read_bytes() for path in frames_of(adapter)]):
        for sample in given_.samples:
            assert signal(sample.signal).name == sample.signal
            assert sample.value is not None or sample.reason
            assert sample.quality is Quality.GOOD or sample.value is None


@every_adapter
def test_a_frame_that_comes_twice_gives_nothing_new(adapter: Adapter) -> None:
    config, cursor = config_of(adapter), adapter.start(config_of(adapter))
    for path in frames_of(adapter):
        cursor, first = adapter.parse(config, cursor, path.read_bytes())
        if first.error is None:
            assert adapter.parse(config, cursor, path.read_bytes())[1].samples == ()


@every_adapter
def test_its_cursor_is_frozen_plain_json_and_parsing_is_pure(adapter: Adapter) -> None:
    config = config_of(adapter)
    for cursor, _ in played(adapter, [path.read_bytes() for path in frames_of(adapter)]):
        kind: TypeAdapter[Any] = TypeAdapter(type(cursor))
        copy = kind.validate_json(kind.dump_json(cursor))
        assert copy == cursor
        assert hash(copy) == hash(cursor)
        for path in frames_of(adapter):
            assert adapter.parse(config, cursor, path.read_bytes()) == adapter.parse(config, copy, path.read_bytes())


@every_adapter
@given(data=st.data())
def test_a_truncated_or_corrupt_frame_never_crashes_it_and_a_truncated_one_gives_no_value(
    adapter: Adapter, data: st.DataObject
) -> None:
    frames = [path.read_bytes() for path in frames_of(adapter)]
    number = data.draw(st.integers(0, len(frames) - 1))
    config, raw = config_of(adapter), frames[number]
    before = played(adapter, frames[:number])[-1][0] if number else adapter.start(config)
    _, torn = adapter.parse(config, before, raw[: data.draw(st.integers(0, len(raw) - 1))])
    assert (torn.samples, torn.received) == ((), 0)
    assert torn.error
    at, patch = data.draw(st.integers(0, len(raw) - 1)), data.draw(st.binary(max_size=8))
    _, corrupt = adapter.parse(config, before, raw[:at] + patch + raw[at + data.draw(st.integers(0, 8)) :])
    assert corrupt.accounted()


@every_adapter
def test_it_yields_tool_number_and_tool_change_active_or_says_that_it_cannot(adapter: Adapter) -> None:
    pipeline, published, offered = Pipeline(config_of(adapter)), list[EdgeSample](), set[str]()
    for _, given_ in played(adapter, [path.read_bytes() for path in frames_of(adapter)]):
        offered |= {offer.signal for offer in given_.offers or ()}
        published += [sample for row in pipeline.take(given_, arrival_s=0.0).rows for sample in row]
    active = [sample.value for sample in published if sample.signal == "tool_change_active"]
    if offered & {"tool_number", "nc_block"}:
        assert {True, False} <= set(active)
        assert any(sample.signal == "tool_number" and sample.value for sample in published)
    else:
        assert not_observable(0)[0].reason
