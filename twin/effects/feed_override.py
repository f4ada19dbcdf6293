"""The knobs stand elsewhere than the twin was told: feeds and rapids are scaled.

F = ratio · F_programmed,   rapid = ratio_rapid · rapid_stated

An override that a recording tells is an input of the run, and no effect: this is one that nobody recorded.
"""

from twin.effects.effect import Effect, On, Parameter
from twin.sites import Site


def feed_ratio(stated: float, ratio: float) -> float:
    """Return the share of the programmed feed."""
    return stated * ratio


def rapid_ratio(stated: float, rapid: float) -> float:
    """Return the share of the rapid rate."""
    return stated * rapid


EFFECT = Effect(
    name="feed_override",
    says="the knobs stand elsewhere",
    site=Site.PROGRAM,
    on=On.MACHINE,
    parameters=(
        Parameter("ratio", "", 1.0, 0.01, 2.0, 0.8, "feed over programmed feed"),
        Parameter("rapid", "", 1.0, 0.01, 2.0, 0.5, "rapid rate over the stated one"),
    ),
    changes={"feed_ratio": feed_ratio, "rapid_ratio": rapid_ratio},
    shows_in=("feed_mm_min", "line"),
    equation="F = ratio · F_programmed; rapid = ratio_rapid · rapid_stated",
    reference="ISO 6983-1:2009, feed override; MTConnect PathFeedrateOverride",
)
