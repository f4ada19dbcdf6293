"""docs/reference/effects.md: the catalogue of effects, from what each declares."""

from twin.effects.catalogue import catalogue
from twin.effects.effect import On, Parameter
from twin.learned.sites import AXIS_SITES, MACHINE_READINGS, READINGS, unit_at
from twin.learned.words import TIME, WORDS, LearnedSite
from twin.sites import Site

WHAT = {
    LearnedSite.CONTROLLER: "the torque command",
    LearnedSite.AXIS_FORCE: "the force on an axis, + towards +",
    LearnedSite.FRICTION: "friction and breakaway, + resists more",
    LearnedSite.TABLE_POSITION: "the table against the motor",
    LearnedSite.POSITION_READING: "what the scale of the motor reads",
    LearnedSite.TABLE_READING: "what the scale of the table reads",
    LearnedSite.TORQUE_READING: "what is recorded of the torque",
    LearnedSite.CUT_FORCE: "K_t where it is on nothing; on x or y the force on the tool in N, while it cuts",
    LearnedSite.FORCE_READING: "what the dynamometer reads",
    LearnedSite.SPINDLE_POWER: "the electrical power of the spindle",
    LearnedSite.HEAT_INPUT: "the heat that goes into the spindle",
    LearnedSite.HEAT_LOSS: "the heat that it loses",
    LearnedSite.TEMPERATURE_READING: "what the sensor of its temperature reads",
    LearnedSite.PROGRAM_TIME: "the seconds of a program, over those that it takes without",
}


def _placed(site: LearnedSite) -> str:
    if site in AXIS_SITES:
        return "axis"
    if site in READINGS:
        return f"axis, or `x_{READINGS[site]}`"
    if site in MACHINE_READINGS:
        return " or ".join(f"`{column}`" for column in MACHINE_READINGS[site])
    return "–, `x` or `y`" if site is LearnedSite.CUT_FORCE else "–"


SITES = [f"| `{site}` | {_placed(site)} | {WHAT[site]}, {unit_at(site)} |" for site in LearnedSite]
HEAD = """\
# Effects

For whoever reads a diagnosis or gives a simulated machine a fault: what a machine may have beyond the nominal
model ([the simulated machine](../explanation/simulator.md)). Each effect is one file in `twin/effects/`, found
by discovery, and written into a `machine.toml` like this:

```toml
[[effects]]
effect = "gravity"
on = "z"
parameters = { force_n = -310.0 }
```

`on` is an axis letter, a column of the run log, or empty; an effect of the cut may be on one of `[tools]`, by its number. At its null
value an effect is not there, bit for bit; a parameter without one has no say while the others are null. This page is written by
`scripts/reference`.

## Learned terms
What a machine has and no catalogue names is a table, found by [gap diagnose](../explanation/gap.md) and written beside the effects. An entry of
`learned` in `diagnosis.json` works as it is; several may stand on one place:

```toml
[[effects]]
effect = "learned"
site = "friction"
on = "x"
table = { position_mm = [0.0, 118.0, 0.0, 118.0], direction = [-1.0, -1.0, 1.0, 1.0], value = [0.0, 12.0, 0.0, 43.0] }
```

A table has the columns of one or two arguments, `value`, and if known its band `low` and `high`; a row is a knot, in any order, and of
two arguments each value of one goes with each of the other. Between knots it is linear, beyond its ends it stays as it ends. One over
`t_s` with a column `run` describes the time of recordings: it is kept, and in no simulation of another run.

| site | on | is added to |
|---|---|---|
{sites}

It may depend on {arguments}, or on another axis as `y_position_mm`, `y_velocity_mm_s`, `y_acceleration_mm_s2`. Velocity, direction
and acceleration are those of the reference, of a rotary axis in degrees (`position_deg`) with forces in N m; a chip is the mean of the teeth that are in the cut; the load of a
spindle's power is the one without the term; the rest is what the machine itself
does ([decision 24](../decisions/0024-a-learned-term-is-a-series.md)).
""".replace("{sites}", "\n".join(SITES)).replace("{arguments}", ", ".join(f"`{column}`" for column in WORDS if column != TIME))


def page() -> str:
    """The page, sites in the order in which the simulation calls them."""
    lines = [HEAD]
    for site in Site:
        effects = [effect for effect in catalogue().values() if effect.site is site]
        if not effects:
            continue
        lines += [
            f"## {site.value.capitalize()}",
            "",
            "| effect | in plain words | on | equation | parameters | shows in |",
            "|---|---|---|---|---|---|",
        ]
        for effect in effects:
            on = {On.AXIS: "axis", On.SIGNAL: "signal", On.MACHINE: "–"}[effect.on]
            parameters = "<br>".join(_parameter(p) for p in effect.parameters)
            shown = ", ".join(f"`{name}`" for name in effect.shows_in)
            equation = effect.equation.replace("|", "\\|")
            lines.append(f"| `{effect.name}` | {effect.says.format(on='…')} | {on} | {equation} | {parameters} | {shown} |")
        lines += ["", *(f"* `{effect.name}`: {effect.reference}" for effect in effects), ""]
    return "\n".join(lines)


def _parameter(p: Parameter) -> str:
    null = "no null value" if p.null is None else f"null {p.null:g}"
    return f"`{p.name}`{' ' + p.unit if p.unit else ''}: {p.meaning}; {null}, {p.low:g} to {p.high:g}".replace("|", "\\|")
