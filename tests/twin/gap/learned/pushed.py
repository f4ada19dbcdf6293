"""The stage of a small axis to whose recordings a term has been added that no catalogue has."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.twin.gap.small_case import air_case
from twin.gap.fitting import Fitted, fitted
from twin.gap.stages.axis import AxisStage
from twin.gap.stages.free_term import FreeTerm
from twin.gap.stages.plan import axis_stage, ground_of
from twin.gap.stages.stage import Model
from twin.learned.knots import Knots
from twin.learned.words import LearnedSite
from twin.machine import AddedEffect

Floats = NDArray[np.float64]


def healthy_stage(*effects: AddedEffect) -> AxisStage:
    """The axis of the small case, as it is; with these effects in its machine."""
    stage = axis_stage(ground_of(air_case(*effects), frozenset()), "z", {})
    assert stage is not None
    return stage


def stage_with(site: LearnedSite, knots: Mapping[str, Floats], shape: Callable[..., Floats], *effects: AddedEffect) -> AxisStage:
    """The same with a term: its values at the knots are `shape` of the knots of each argument; effects: of the catalogue, too."""
    stage = healthy_stage(*effects)
    term = FreeTerm(site, "z", Knots(knots), 1.0, {})
    values = shape(*(v.ravel() for v in np.meshgrid(*knots.values(), indexing="ij")))
    model = Model((), ()).with_term(term)
    theta = np.linalg.solve(term.root, values)[None, :]
    runs = []
    for run in stage.runs:
        shown, bare = (stage.simulate(m, t, run) for m, t in ((model, theta), (Model((), ()), np.zeros((1, 0)))))
        where = np.concatenate([np.arange(len(run.t_s))[s] for s in run.stretches()])
        measured = {output: values.copy() for output, values in run.measured.items()}
        for output, own in measured.items():
            own[where] += (shown[output] - bare[output])[0]
        runs.append(replace(run, measured=measured))
    return replace(stage, runs=tuple(runs))


def refitted(stage: AxisStage) -> Fitted:
    """The stage with its constants fitted."""
    model = Model(stage.constants, ())
    return fitted(stage, model, model.null_theta())
