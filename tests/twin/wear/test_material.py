"""The explanation of a part: a step of all is another batch, a fall of one to sharp is a replacement, a rise of one is odd."""

import pytest

from twin.wear.joint import MATERIAL, Joint, Observed, with_tool
from twin.wear.material import Batches, Explained, Seen, explained
from twin.wear.terms import Terms
from twin.wear.trend import Trend

WORN = 0.25


def explained_of(*levels: float) -> Explained:
    joint = Joint()
    for number in range(len(levels)):
        joint = with_tool(joint, str(number), Trend(0.8, 0.01, 4e-4, 0.0, 1e-6))
    seen = [
        Seen(Observed(str(number), level, 1e-4, WORN, 0.3), Observed(str(number), level, 5e-4, 0.0, 0.0), is_due=True)
        for number, level in enumerate(levels)
    ]
    return explained(joint, seen, Batches(), Terms())


@pytest.mark.parametrize(
    ("levels", "is_batch", "replaced", "material"),
    [
        ((0.25, 0.25, 0.25, 0.25), False, set(), 0.0),
        ((0.35, 0.34, 0.36, 0.35), True, set(), 0.1),
        ((0.17, 0.16, 0.17, 0.18), True, set(), -0.08),
        ((0.25, 0.0, 0.25, 0.25), False, {"1"}, 0.0),
        ((0.33, 0.08, 0.33, 0.33), True, {"1"}, 0.08),
        ((0.25, 0.25, 0.70, 0.25), False, set(), 0.0),
    ],
    ids=["as it was", "harder", "softer", "replaced", "harder and replaced", "a broken insert"],
)
def test_a_part_is_explained(levels: tuple[float, ...], is_batch: bool, replaced: set[str], material: float) -> None:
    found = explained_of(*levels)
    assert found.is_batch is is_batch
    assert found.replaced == replaced
    assert found.joint.means[MATERIAL] == pytest.approx(material, abs=0.02)
