"""An answer in the units of its machine: what concerns a rotary axis in degrees and N m, under the names that files have.

Everything before is as for linear axes (`twin.rotary`); this is the last step of a diagnosis.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

from twin.gap.diagnosis import Cause, Cell, Diagnosed, Interval, Learned, MovedConstant, Pattern, SignalGap
from twin.gap.naming.sentence import figure_of
from twin.machine import MachineFile
from twin.rotary import Letters, outside_name, outside_names, outside_path, outside_text, outside_unit
from twin.rotary_tables import is_on, term_outside


@dataclass(frozen=True, slots=True)
class _Axes:
    """The rotary axes of a machine with their scales, and the letters of the others."""

    rotary: Letters
    others: frozenset[str]

    def turns(self, on: str) -> bool:
        """Return True where this is a rotary axis, or a signal of one."""
        return is_on(on, self.rotary)

    def alone(self, on: str) -> Letters:
        """The axis that this is, or is a signal of."""
        return {letter: scale for letter, scale in self.rotary.items() if is_on(on, (letter,))}

    def text(self, text: str) -> str:
        """Return a text that may speak of any axis."""
        return outside_text(text, self.rotary, self.others)


def in_own_units(found: Diagnosed, machine: MachineFile) -> Diagnosed:
    """Return the answer with what concerns the rotary axes of the machine in degrees and N m; as it is where there are none."""
    if not machine.rotary:
        return found
    axes = _Axes(machine.rotary, frozenset(machine.axes.keys() - machine.rotary.keys()))
    traces = tuple(
        replace(t, signal=outside_names(t.signal, axes.rotary), unit=_unit(axes, t.signal, t.unit)) for t in found.traces
    )
    told = found.diagnosis
    for cause in told.causes:
        if cause.on in axes.rotary:  # to as many digits as it has, and not those of its rounded figure
            for inside, outside in zip(cause.parameters.values(), _cause(cause, axes).parameters.values(), strict=True):
                told = replace(told, sentence=told.sentence.replace(figure_of(inside), figure_of(outside)))
    return replace(found, diagnosis=_told(told, axes), traces=traces)


def _unit(axes: _Axes, signal: str, unit: str) -> str:
    return outside_unit(unit)[0] if axes.turns(signal) else unit


def _told(value: Any, axes: _Axes) -> Any:
    """Any part of an answer."""
    if isinstance(value, str):
        return axes.text(value) if type(value) is str else value
    if isinstance(value, tuple):
        return tuple(_told(one, axes) for one in value)
    if isinstance(value, Mapping):
        return {_told(key, axes): _of_signal(one, key, axes) for key, one in value.items()}
    if isinstance(value, Cell | Pattern):
        value = _cell(value, axes)
    if isinstance(value, Cause) and axes.turns(value.on):
        return _cause(value, axes)
    if isinstance(value, MovedConstant):
        return _constant(value, axes)
    if isinstance(value, Learned) and axes.turns(value.on):
        return _learned(value, axes)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: _told(getattr(value, f.name), axes) for f in fields(value) if f.name != "program"})
    return value


def _of_signal(value: Any, signal: str, axes: _Axes) -> Any:
    if isinstance(value, SignalGap):
        return replace(value, unit=_unit(axes, signal, value.unit))
    return _told(value, axes)


def _cell(cell: Cell | Pattern, axes: _Axes) -> Cell | Pattern:
    """A cell or pattern; its sentence speaks of the axis of its signal."""
    if not axes.turns(cell.signal):
        return cell
    cell = replace(cell, sentence=outside_text(cell.sentence, axes.alone(cell.signal), ()))
    return replace(cell, at_unit=outside_unit(cell.at_unit)[0]) if isinstance(cell, Pattern) else cell


def _cause(cause: Cause, axes: _Axes) -> Cause:
    on_axis = cause.on in axes.rotary
    parameters = {}
    for name, interval in cause.parameters.items():
        told, factor = outside_name(name, axes.rotary[cause.on]) if on_axis else (name, 1.0)
        unit = outside_unit(interval.unit)[0]
        parameters[told] = Interval(interval.value / factor, interval.low / factor, interval.high / factor, unit)
    return replace(
        cause,
        on=outside_names(cause.on, axes.rotary),
        parameters=parameters,
        indistinguishable_from=_told(cause.indistinguishable_from, axes),
    )


def _constant(constant: MovedConstant, axes: _Axes) -> MovedConstant:
    path = outside_path(constant.name, axes.rotary)
    letter = constant.name.split(".")[1] if path != constant.name else ""
    factor = outside_name(constant.name, axes.rotary[letter])[1] if letter in axes.rotary else 1.0
    return replace(constant, name=path, stated=constant.stated / factor, found=constant.found / factor)


def _learned(learned: Learned, axes: _Axes) -> Learned:
    """A learned term on a rotary axis; its sentence speaks of that axis."""
    return replace(
        learned,
        on=outside_names(learned.on, axes.rotary),
        unit=_unit(axes, learned.on, learned.unit),
        table={name: tuple(v) for name, v in term_outside(learned.table, learned.on, learned.unit, axes.rotary).items()},
        looks_like=_told(learned.looks_like, axes),
        sentence=outside_text(learned.sentence, axes.alone(learned.on), ()),
    )
