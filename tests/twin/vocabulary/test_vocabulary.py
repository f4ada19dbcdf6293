"""The vocabulary stands on nothing, and says each thing once."""

import ast
import importlib
import pkgutil
import sys
from pathlib import Path

import pytest

import twin.vocabulary
from twin.vocabulary import twin_signals
from twin.vocabulary.signals import DERIVED, SIGNALS, Kind, canonical

MODULES = [module.name for module in pkgutil.iter_modules(twin.vocabulary.__path__, "twin.vocabulary.")]


@pytest.mark.parametrize("name", MODULES)
def test_it_imports_the_standard_library_and_itself(name: str) -> None:
    tree = ast.parse(Path(str(importlib.import_module(name).__file__)).read_text())
    imported = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    imported += [alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names]
    others = {one for one in imported if one.split(".")[0] not in sys.stdlib_module_names}
    assert {one for one in others if not one.startswith("twin.vocabulary")} == set()


@pytest.mark.parametrize("name", [*SIGNALS, "axis_x_pos_mm", "axis_c_pos_deg", "axis_z4_load_pct"])
def test_a_canonical_signal_has_a_meaning_and_a_number_its_unit_and_limits(name: str) -> None:
    signal = canonical(name)
    assert signal is not None and signal.name == name and signal.meaning
    has_limits = signal.low is not None and signal.high is not None and signal.low < signal.high
    assert (signal.kind is Kind.NUMBER) == has_limits == bool(signal.unit)
    assert not signal.words or signal.kind is Kind.TEXT


def test_what_is_derived_is_canonical() -> None:
    assert set(DERIVED) <= set(SIGNALS)


def test_a_name_of_the_twin_is_declared_once() -> None:
    names = [value for key, value in vars(twin_signals).items() if key.isupper() and isinstance(value, str)]
    assert len(set(names)) == len(names)
    assert all(name.startswith(twin_signals.TWIN_PREFIX) for name in names)
