"""The figures in the docstrings are right."""

import doctest
import importlib
import pkgutil

import pytest

import cnctwin.standins.mtconnect_agent

MODULES = [m.name for m in pkgutil.iter_modules(cnctwin.standins.mtconnect_agent.__path__, "cnctwin.standins.mtconnect_agent.")]


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_the_docstrings_hold(name: str) -> None:
    assert doctest.testmod(importlib.import_module(name)).failed == 0


def test_there_are_examples_to_check() -> None:
    assert sum(doctest.testmod(importlib.import_module(name)).attempted for name in MODULES) > 20
