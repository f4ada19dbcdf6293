"""The learned terms that are tried: over what every run tells."""

from dataclasses import replace

import numpy as np

from tests.twin.gap.learned.pushed import healthy_stage
from twin.gap.learned.shapes import shapes_of


def test_a_term_depends_on_nothing_that_a_run_does_not_tell() -> None:
    stage = healthy_stage()
    warm = [replace(run, around={"temperature_c": np.linspace(20.0, 30.0, len(run.t_s))}) for run in stage.runs]
    told, untold = (replace(stage, runs=runs) for runs in (tuple(warm), (*warm[:-1], stage.runs[-1])))
    columns = [{c for term in shapes_of(one) for c in term.knots.columns} for one in (told, untold)]
    assert columns[0] - columns[1] == {"temperature_c"}
