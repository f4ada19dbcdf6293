"""The catalogue: every `twin/effects/<name>.py` that ends in `EFFECT = Effect(...)`. A new effect is one new file."""

import importlib
import pkgutil
from functools import cache

import twin.effects
from twin.effects.effect import Effect
from twin.errors import EffectError

_MECHANISM = {"added", "catalogue", "effect"}


@cache
def catalogue() -> dict[str, Effect]:
    """All effects by name, in order of their names."""
    found: dict[str, Effect] = {}
    for module in sorted(pkgutil.iter_modules(twin.effects.__path__), key=lambda m: m.name):
        if module.name in _MECHANISM:
            continue
        effect = importlib.import_module(f"twin.effects.{module.name}").EFFECT
        assert isinstance(effect, Effect) and effect.name == module.name, f"twin/effects/{module.name}.py declares no such effect"
        found[effect.name] = effect
    return found


def effect_named(name: str) -> Effect:
    """The effect `name`. Raises EffectError with the known names where there is none."""
    try:
        return catalogue()[name]
    except KeyError:
        raise EffectError(f"there is no effect {name!r}; known are {', '.join(catalogue())}") from None
