"""Weaves effects, recordings and traces into the physics, at the marked places (`twin.sites`).

The physics of a stage is a list of small functions that share their names: what one returns, the next takes. Weaving reads
their source and lays the bodies one after another into one scope. At each `quantity = at(Site.X, value)` it adds a call for
every effect that changes the quantity there, or takes the quantity from a recording instead. What comes out is plain Python
text: the reference runs it as it is, the kernels compile it.

Everything an effect brings is renamed `effect__name`, so that effects know nothing of each other.
"""

import ast
import inspect
import textwrap
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from twin.effects.effect import Effect
from twin.errors import EffectError
from twin.kernels.parsing import parsed

Physics = Callable[..., object]


@dataclass(frozen=True, slots=True)
class Woven:
    """A stage as text.

    body: the statements, unindented
    takes: names it reads before it sets them: inputs, states and constants
    sets: names it sets
    functions: source of the effects' functions that it calls
    """

    body: str
    takes: tuple[str, ...]
    sets: tuple[str, ...]
    functions: tuple[str, ...]


@dataclass(slots=True)
class _Weaver:
    effects: tuple[Effect, ...]
    replaced: frozenset[str]
    added: frozenset[str]
    statements: list[ast.stmt] = field(default_factory=list)
    takes: dict[str, None] = field(default_factory=dict)
    sets: dict[str, None] = field(default_factory=dict)
    functions: dict[str, str] = field(default_factory=dict)

    def add(self, statement: ast.Assign) -> None:
        """Appends an assignment and keeps account of what it reads and sets."""
        for node in ast.walk(statement.value):
            if isinstance(node, ast.Name) and not self._is_called(node, statement) and node.id not in self.sets:
                self.takes[node.id] = None
        for target in statement.targets:
            for node in ast.walk(target):
                if isinstance(node, ast.Name):
                    self.sets[node.id] = None
        self.statements.append(statement)

    @staticmethod
    def _is_called(name: ast.Name, statement: ast.Assign) -> bool:
        return any(isinstance(node, ast.Call) and node.func is name for node in ast.walk(statement.value))

    def quantity(self, name: str, value: ast.expr) -> None:
        """A marked quantity: from the recording where it is replaced, else nominal and then as the effects change it."""
        if name in self.replaced:
            self.add(_assignment(name, f"recorded__{name}"))
            return
        if not (isinstance(value, ast.Name) and value.id == name):
            self.add(ast.Assign(targets=[ast.Name(name, ast.Store())], value=value))
        for effect in self.effects:
            if name in effect.changes:
                self._change(name, effect)
        if name in self.added:
            self.add(_assignment(name, f"{name} + added__{name}"))

    def _change(self, quantity: str, effect: Effect) -> None:
        function = effect.changes[quantity]
        called = f"{effect.name}__{quantity}__change"
        self.functions[called] = function_text(function, called)
        own = {p.name for p in effect.parameters} | set(effect.states)
        taken = [f"{effect.name}__{name}" if name in own else name for name in list(inspect.signature(function).parameters)[1:]]
        states = [f"{effect.name}__{name}" for name in effect.states if name in inspect.signature(function).parameters]
        self.add(_assignment(", ".join([quantity, *states]), f"{called}({', '.join([quantity, *taken])})"))


def _assignment(target: str, value: str) -> ast.Assign:
    statement = parsed(f"{target} = {value}").body[0]
    assert isinstance(statement, ast.Assign)
    return statement


def function_text(function: Physics, name: str | None = None) -> str:
    """The source of a function, without docstring and annotations, called `name`."""
    tree = parsed(textwrap.dedent(inspect.getsource(function))).body[0]
    assert isinstance(tree, ast.FunctionDef)
    tree.name = name or tree.name
    tree.returns = None
    for argument in tree.args.args:
        argument.annotation = None
    if ast.get_docstring(tree) is not None:
        tree.body = tree.body[1:]
    return ast.unparse(tree)


def quantities(physics: Iterable[Physics]) -> dict[str, str]:
    """The marked quantities of a stage, with the site of each (the name of the member of Site)."""
    found: dict[str, str] = {}
    for function in physics:
        for node in ast.walk(parsed(textwrap.dedent(inspect.getsource(function)))):
            if isinstance(node, ast.Assign) and _is_mark(node.value):
                assert isinstance(node.targets[0], ast.Name) and isinstance(node.value, ast.Call)
                site = node.value.args[0]
                assert isinstance(site, ast.Attribute)
                found[node.targets[0].id] = site.attr
    return found


def weave(
    physics: Iterable[Physics], effects: Iterable[Effect] = (), replaced: Iterable[str] = (), added: Iterable[str] = ()
) -> Woven:
    """The text of a stage with these effects in it.

    replaced: quantities that are read as `recorded__<quantity>`; added: those that have `added__<quantity>` put on top

    Effects come in the order given. One that changes nothing in this stage is passed over, so that the caller may hand all
    stages the same effects.

    Raises EffectError where a quantity to be replaced or added to is not marked in this stage.
    """
    physics = tuple(physics)
    known = quantities(physics)
    weaver = _Weaver(tuple(effects), frozenset(replaced), frozenset(added))
    for name in weaver.replaced | weaver.added:
        if name not in known:
            raise EffectError(f"{name!r} is not a quantity that can be replaced or added to here; these are: {', '.join(known)}")
    for function in physics:
        tree = parsed(textwrap.dedent(inspect.getsource(function))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        for statement in tree.body:
            if isinstance(statement, ast.Assign) and _is_mark(statement.value):
                assert isinstance(statement.targets[0], ast.Name) and isinstance(statement.value, ast.Call)
                weaver.quantity(statement.targets[0].id, statement.value.args[1])
            elif isinstance(statement, ast.Assign):
                weaver.add(statement)
            else:
                docstring = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
                assert docstring or isinstance(statement, ast.Return), f"{function}: physics is assignments and one return"
    body = "\n".join(ast.unparse(ast.fix_missing_locations(statement)) for statement in weaver.statements)
    return Woven(body, tuple(weaver.takes), tuple(weaver.sets), tuple(weaver.functions.values()))


def _is_mark(value: ast.expr) -> bool:
    return isinstance(value, ast.Call) and isinstance(value.func, ast.Name) and value.func.id == "at"
