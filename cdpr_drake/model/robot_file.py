"""Records from and to YAML files.

Drake's typed reader (`pydrake.common.yaml.yaml_load_typed`) fills a mutable, default-constructible
schema, and its errors name at most the last part of a field. A `Record` is frozen and has required
fields, so its schema is derived from it here, and a walk over the document first finds what does
not fit, with the whole path of the field.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import reprlib
from collections.abc import Iterator
from typing import Any, TypeVar

import numpy as np
import yaml  # type: ignore[import-untyped]
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.common.yaml import yaml_dump_typed, yaml_load_typed
from pydrake.math import RigidTransform, RotationMatrix

from cdpr_drake.errors import RobotFileError
from cdpr_drake.model.records import (
    Record,
    cached,
    field_types,
    is_record,
    item_type,
    one_line,
    optional_type,
)

R = TypeVar("R", bound=Record)


def read_record(cls: type[R], text: str, file: str) -> R:
    """Reads a record from the text of a YAML file.

    Args:
        cls: the record's class; fields with a default may be left out.
        text: the YAML document. Root keys that start with an underscore are for anchors only.
        file: what errors call the file.

    Raises:
        RobotFileError: naming the file, and the field with its whole path.
    """
    try:
        _inspect(_parse(text), cls)
        return _build(cls, yaml_load_typed(schema=_schema(cls), data=text))
    except RobotFileError as error:
        raise RobotFileError(file, error.field, error.message) from None
    except (AssertionError, RuntimeError, TypeError, ValueError) as error:
        raise RobotFileError(file, "", one_line(error)) from error


def write_record(record: Record) -> str:
    """Writes a record as YAML text that `read_record` reads back to an equal record.

    Args:
        record: any record.
    """
    return yaml_dump_typed(_to_schema(record), schema=_schema(type(record)))


@cached
def _schema(cls: type[Record]) -> Any:
    """The mutable, default-constructible twin of a record class that Drake's reader fills."""
    members = []
    for field in dataclasses.fields(cls):
        kind = field_types(cls)[field.name]
        member = _member(kind)
        default = functools.partial(_schema_default, field, member)
        members.append((field.name, member, dataclasses.field(default_factory=default)))
    return dataclasses.make_dataclass(cls.__name__, members)


def _member(kind: Any) -> Any:
    item = item_type(kind)
    if item is not None:
        return list[_member(item)]  # type: ignore[misc]
    if kind is RigidTransform:
        return _schema(_Pose)
    if is_record(kind):
        return _schema(kind) | float if kind.shorthand else _schema(kind)
    return kind


def _schema_default(field: Any, member: Any) -> Any:
    if field.default is not dataclasses.MISSING:
        return _to_schema(field.default)
    if field.default_factory is not dataclasses.MISSING:
        return _to_schema(field.default_factory())
    # `_inspect` has seen that the field is there; Drake fills a nested schema in place.
    return member() if isinstance(member, type) and dataclasses.is_dataclass(member) else None


def _to_schema(value: Any) -> Any:
    if isinstance(value, RigidTransform):
        value = _Pose.of(value)
    if isinstance(value, Record):
        fields = field_types(type(value))
        return _schema(type(value))(**{f: _to_schema(getattr(value, f)) for f in fields})
    return [_to_schema(item) for item in value] if isinstance(value, tuple) else value


# Below, errors name a field relative to the value at hand; `_inside` adds the way there.


@contextlib.contextmanager
def _inside(name: str) -> Iterator[None]:
    try:
        yield
    except RobotFileError as error:
        dot = "." if error.field and not error.field.startswith("[") else ""
        field = f"{name}{dot}{error.field}"
        raise RobotFileError("", field, error.message) from None


def _build(cls: type[R], schema: Any) -> R:
    values = {}
    for name, kind in field_types(cls).items():
        with _inside(name):
            values[name] = _build_value(kind, getattr(schema, name))
    return cls(**values)


def _build_value(kind: Any, value: Any) -> Any:
    if optional_type(kind) is not None:
        return None if value is None else _build_value(optional_type(kind), value)
    item, items = item_type(kind), []
    if item is not None:
        for index, entry in enumerate(value):
            with _inside(f"[{index}]"):
                items.append(_build_value(item, entry))
        return tuple(items)
    if kind is RigidTransform:
        return _build(_Pose, value).transform()
    if dataclasses.is_dataclass(value):
        return _build(kind, value)
    return float(value) if kind is float else value  # YAML 1.1 takes 1e-3 for text


def _parse(text: str) -> Any:
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
        _inspect_keys(node, "")
        data = None if node is None else yaml.SafeLoader("").construct_document(node)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f"line {mark.line + 1}: " if mark else ""
        raise RobotFileError("", "", f"{where}not valid YAML: {error.problem}") from None
    except yaml.YAMLError as error:
        raise RobotFileError("", "", f"not valid YAML: {one_line(error)}") from None
    if isinstance(data, dict):  # as Drake's reader, which drops what only holds anchors
        data = {key: value for key, value in data.items() if not key.startswith("_")}
    return data


def _inspect_keys(node: yaml.Node | None, where: str) -> None:
    """PyYAML keeps the last of two equal keys without a word; Drake's reader takes only text."""
    if isinstance(node, yaml.MappingNode):
        lines: dict[str, int] = {}
        for key, value in node.value:
            name = key.value if isinstance(key, yaml.ScalarNode) else "(a key)"
            field, line = f"{where}{name}", key.start_mark.line + 1
            if key.tag not in ("tag:yaml.org,2002:str", "tag:yaml.org,2002:merge"):
                raise RobotFileError("", field, f"must be text to be a field's name, line {line}")
            if field in lines:
                both = f"lines {lines[field]} and {line}"
                raise RobotFileError("", field, f"is given twice, on {both}")
            lines[field] = line
            _inspect_keys(value, f"{field}.")


def _inspect(value: Any, kind: Any) -> None:
    """Raises RobotFileError if a parsed YAML value does not have the form of `kind`."""
    got = f"got {reprlib.repr(value)}"
    if optional_type(kind) is not None:
        if value is None:
            return
        kind = optional_type(kind)
    if kind is RigidTransform:
        kind = _Pose
    if is_record(kind):
        if not (kind.shorthand and _is_number(value)):
            _inspect_fields(value, kind, got)
    elif kind is float or kind is int:
        if not _is_number(value) or (kind is int and not float(value).is_integer()):
            raise RobotFileError("", "", f"must be a {_NUMBER_NAMES[kind]}, {got}")
    elif kind is np.ndarray:
        _inspect_array(value, got)
    elif kind is str:
        if not isinstance(value, str):
            raise RobotFileError("", "", f"must be text, {got}")
    elif item_type(kind) is not None:
        _inspect_items(value, item_type(kind), got)
    elif not isinstance(value, dict) or not all(
        isinstance(item, str) for pair in value.items() for item in pair
    ):
        raise RobotFileError("", "", f"must map names to texts, {got}")


_NUMBER_NAMES = {float: "number", int: "whole number"}


def _inspect_fields(value: Any, cls: type[Record], got: str) -> None:
    types = field_types(cls)
    if not isinstance(value, dict):
        raise RobotFileError("", "", f"must be a mapping with {', '.join(types)}; {got}")
    for name in map(str, value):
        if name not in types:
            close = difflib.get_close_matches(name, types, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(types)}"
            raise RobotFileError("", name, f"unknown field; {hint}")
    for field in dataclasses.fields(cls):
        optional = not (field.default is field.default_factory is dataclasses.MISSING)
        if field.name in value:
            with _inside(field.name):
                _inspect(value[field.name], types[field.name])
        elif not optional:
            raise RobotFileError("", field.name, "is missing")


def _inspect_items(value: Any, item: Any, got: str) -> None:
    texts = item is str and isinstance(value, list) and all(isinstance(v, str) for v in value)
    if not isinstance(value, list) or (item is str and not texts):
        raise RobotFileError("", "", f"must be a list{' of texts' if item is str else ''}, {got}")
    for index, entry in enumerate(value):
        with _inside(f"[{index}]"):
            _inspect(entry, item)


def _inspect_array(value: Any, got: str) -> None:
    def leaves(item: Any) -> Iterator[Any]:
        if isinstance(item, list):
            for entry in item:
                yield from leaves(entry)
        else:
            yield item

    for leaf in leaves(value):
        if not _is_number(leaf):
            raise RobotFileError("", "", f"must hold numbers, not {reprlib.repr(leaf)}")
    try:
        np.array(value, dtype=float)
    except ValueError:
        raise RobotFileError("", "", f"must have rows of equal length, {got}") from None


def _is_number(value: Any) -> bool:
    try:
        float(value)
    except (TypeError, ValueError, OverflowError):
        return False
    return not isinstance(value, bool)


@dataclasses.dataclass(frozen=True, kw_only=True, eq=False)
class _Pose(Record):
    """A RigidTransform as a file writes it.

    Args:
        rotation: rotation vector (3,) [rad], or rotation matrix (3, 3).
        translation: (3,) [m].
    """

    rotation: np.ndarray
    translation: np.ndarray

    @classmethod
    def of(cls, X: RigidTransform) -> _Pose:
        """A rotation vector if one gives `X` back to the last bit, else the matrix."""
        matrix: Any = X.rotation().matrix()
        angle_axis = X.rotation().ToAngleAxis()
        vector: Any = angle_axis.angle() * np.asarray(angle_axis.axis())
        translation: Any = X.translation()
        for rotation in (np.round(vector, 12), vector):
            if np.array_equal(_rotation(rotation).matrix(), matrix):
                return cls(rotation=rotation, translation=translation)
        return cls(rotation=matrix, translation=translation)

    def transform(self) -> RigidTransform:
        """The pose as Drake's type; raises RobotFileError naming the part that is wrong."""
        for name, shapes in (("rotation", ((3,), (3, 3))), ("translation", ((3,),))):
            value = getattr(self, name)
            if value.shape not in shapes:
                wanted = " or ".join(map(str, shapes))
                raise RobotFileError("", name, f"must have shape {wanted}, got {value.shape}")
            if not np.all(np.isfinite(value)):
                raise RobotFileError("", name, f"must be finite, got {value.tolist()}")
        translation: Any = self.translation
        rotation = _rotation(self.rotation)
        if not rotation.IsValid():  # for instance written with ten digits
            given: Any = self.rotation
            if not (
                np.allclose(given @ given.T, np.eye(3), rtol=0.0, atol=1e-6)
                and np.linalg.det(given) > 0.0
            ):
                raise RobotFileError("", "rotation", "is not a rotation matrix")
            rotation = RotationMatrix.ProjectToRotationMatrix(given)
        return RigidTransform(rotation, translation)


def _rotation(value: Any) -> RotationMatrix:
    if value.ndim == 2:
        return RotationMatrix(value)
    angle = float(np.linalg.norm(value))
    return RotationMatrix(AngleAxis(angle, value / angle)) if angle > 0 else RotationMatrix()
