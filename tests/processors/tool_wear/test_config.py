"""The settings of tool wear become those of the model."""

from math import log

import pytest

from processors.tool_wear.config import Config


def test_per_cents_become_logarithms() -> None:
    terms = Config(wear_limit_pct=25.0, material_pct=4.0).terms
    assert terms.wear_limit == pytest.approx(log(1.25))
    assert terms.material == pytest.approx(0.04)


def test_no_limit_is_none() -> None:
    assert Config().terms.wear_limit is None
