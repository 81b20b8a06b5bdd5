"""Records: frozen dataclasses of checked values that compare, hash, pickle and print by value."""

from __future__ import annotations

import dataclasses
import functools
import operator
import reprlib
import types
import typing
from collections.abc import Callable
from typing import Any, ClassVar, TypeVar

import numpy as np
from pydrake.math import RigidTransform

from cdpr_drake.errors import RobotFileError

R = TypeVar("R", bound="Record")
F = TypeVar("F", bound=Callable[..., Any])


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class Record:
    """Base of the frozen, keyword-only dataclasses that make up a robot.

    Values are converted to the type of their field: arrays become read-only float64 copies.
    Records compare and hash by value, and can be pickled and deep-copied.

    Raises:
        RobotFileError: a value cannot be converted to the type of its field.
    """

    # The field a plain number stands for, where a file may give one instead of a mapping.
    shorthand: ClassVar[str | None] = None

    def __post_init__(self) -> None:
        for name, kind in field_types(type(self)).items():
            try:
                value = _convert(getattr(self, name), kind)
            except (TypeError, ValueError) as error:
                raise RobotFileError(type(self).__name__, name, one_line(error)) from None
            object.__setattr__(self, name, value)

    def replace(self: R, **fields: Any) -> R:
        """Returns a copy with some fields changed, checked like a new one.

        Args:
            fields: the new values, by field name.

        Raises:
            RobotFileError: the changed record is not valid.
        """
        return dataclasses.replace(self, **fields)

    def _key(self) -> tuple[Any, ...]:
        return tuple(_hashable(getattr(self, name)) for name in field_types(type(self)))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Record) or type(other) is not type(self):
            return NotImplemented
        return self._key() == other._key()

    def __hash__(self) -> int:
        return hash((type(self), self._key()))

    def __reduce__(self) -> tuple[Any, ...]:
        # numpy forgets the read-only flag of a pickled array, so a copy is built anew.
        fields = {name: getattr(self, name) for name in field_types(type(self))}
        return _rebuild, (type(self), fields)


def _rebuild(cls: type[R], fields: dict[str, Any]) -> R:
    return cls(**fields)


def cached(function: F) -> F:
    """functools.cache for functions of a record class; mypy takes such a class for unhashable.

    Args:
        function: of hashable arguments.
    """
    return functools.cache(function)  # type: ignore[return-value]


@cached
def field_types(cls: type[Record]) -> dict[str, Any]:
    """The type of each field of a record class, by name.

    Args:
        cls: a subclass of Record.
    """
    hints = typing.get_type_hints(cls)
    return {field.name: hints[field.name] for field in dataclasses.fields(cls)}


def is_record(kind: Any) -> bool:
    """Whether the type of a field is a record.

    Args:
        kind: a type, as `field_types` gives it.
    """
    return isinstance(kind, type) and issubclass(kind, Record)


def item_type(kind: Any) -> Any:
    """The type of the items of a field that is a list of any length; None for other fields.

    Args:
        kind: the type of a field; `tuple[T, ...]` has items of type T.
    """
    of = typing.get_args(kind)
    is_list = typing.get_origin(kind) is tuple and len(of) == 2 and of[1] is Ellipsis
    return of[0] if is_list else None


def optional_type(kind: Any) -> Any:
    """The type of a field that may be None, when it is not; None for other fields.

    Args:
        kind: the type of a field; `float | None` is a float that may be None.
    """
    of = typing.get_args(kind)
    is_optional = isinstance(kind, types.UnionType) and len(of) == 2 and of[1] is type(None)
    return of[0] if is_optional else None


def one_line(error: Exception) -> str:
    """The message of an error, on one line.

    Args:
        error: any exception.
    """
    return " ".join(str(error).split())


def _hashable(value: Any) -> Any:
    if isinstance(value, RigidTransform):
        value = value.GetAsMatrix34()
    if isinstance(value, np.ndarray):
        return value.shape, tuple(value.ravel().tolist())
    return tuple(sorted(value.items())) if isinstance(value, dict) else value


def _convert(value: Any, kind: Any) -> Any:
    """The value as `kind`, without guessing: neither text nor truth values count as numbers."""
    if optional_type(kind) is not None:
        return None if value is None else _convert(value, optional_type(kind))
    if kind is float:
        if isinstance(value, (bool, str)) or not hasattr(type(value), "__float__"):
            raise TypeError(f"must be a number, got {reprlib.repr(value)}")
        return float(value)
    if kind is int:
        if isinstance(value, bool):
            raise TypeError(f"must be a whole number, got {reprlib.repr(value)}")
        return operator.index(value)
    if kind is np.ndarray:
        try:
            array = np.array(value, dtype=float, order="C")
        except (TypeError, ValueError):
            raise TypeError(f"must be an array of numbers, got {reprlib.repr(value)}") from None
        array.setflags(write=False)
        return array
    if is_record(kind) and kind.shorthand and not isinstance(value, kind):
        return kind(**{kind.shorthand: value})
    if kind is RigidTransform and isinstance(value, RigidTransform):
        return RigidTransform(value)  # Drake's type is mutable: keep our own
    item = item_type(kind)
    if item is not None and isinstance(value, (list, tuple)):
        return tuple(_convert(entry, item) for entry in value)
    if kind == dict[str, str] and isinstance(value, dict):
        return dict(value)
    if isinstance(kind, type) and isinstance(value, kind):
        return value
    name = getattr(kind, "__name__", kind)
    raise TypeError(f"must be a {name}, got {reprlib.repr(value)}")
