"""Plain values out of a pickle without running it: containers, numbers, words and NumPy arrays, and nothing else.

A pickle is a program that may call any function there is. Here its opcodes are read, not run: what they put together
is put together by this module, and the few functions of NumPy that a pickled array names are told by their names and
never imported or called. Everything else is refused.
"""

import math
import pickletools
import struct
from collections.abc import Callable
from typing import Any, BinaryIO

import numpy as np

from evimo.errors import BadFile

REFIX = "the original file; or export these values as JSON, or as arrays of numbers"
MOST_BYTES = 1 << 30  # that one pickle may claim for its arrays

ARRAY, DTYPE, SCALAR, NDARRAY, ENCODE, DICT = "array", "dtype", "scalar", "ndarray", "encode", "dict"
BUFFER = "buffer"
KNOWN = {
    **{f"{module}.multiarray._reconstruct": ARRAY for module in ("numpy.core", "numpy._core")},
    **{f"{module}.multiarray.scalar": SCALAR for module in ("numpy.core", "numpy._core")},
    **{f"{module}.numeric._frombuffer": BUFFER for module in ("numpy.core", "numpy._core")},
    "numpy.ndarray": NDARRAY,
    "numpy.dtype": DTYPE,
    "_codecs.encode": ENCODE,
    "collections.OrderedDict": DICT,
}
"""The only names that may occur, and what each stands for."""

DAMAGES = (ValueError, TypeError, IndexError, KeyError, AttributeError, OverflowError, struct.error, RecursionError)


class _Name(str):
    """What a name of KNOWN stands for; never a value of the result."""

    __slots__ = ()


class _Array:
    """An array that is being put together."""

    def __init__(self) -> None:
        self.values: Any = None


def plain_value(file: BinaryIO, what: str) -> Any:
    """Return what a pickle holds, from the file's place on; NumPy arrays of objects become (nested) lists.

    Args:
        file: at the pickle's first byte. what: it is, for the error.

    Raises:
        BadFile: it names a function or class that plain values do not need, refers to itself, or is damaged.
    """
    machine = _Machine(what)
    try:
        for opcode, argument, _ in pickletools.genops(file):
            if opcode.name == "STOP":
                return _finished(machine.pop())
            machine.step(opcode.name, argument)
    except DAMAGES as error:
        raise BadFile(f"{what} is a damaged pickle ({error})", fix="copy it again") from error
    raise BadFile(f"{what} is a pickle without an end", fix="copy it again")


class _Machine:
    """The stack and the memory of a pickle that is read."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.stack: list[Any] = []
        self.marks: list[int] = []
        self.memo: dict[int, Any] = {}
        self.bytes = 0

    def step(self, name: str, argument: Any) -> None:
        """Follow one opcode."""
        if name in CONSTANTS:
            self.stack.append(argument)
        elif name in ACTIONS:
            ACTIONS[name](self, argument)
        elif name not in IGNORED:
            raise self.refused(f"the opcode {name}")

    def refused(self, thing: str) -> BadFile:
        """The error for what plain values do not need."""
        return BadFile(f"{self.what} is a pickle with {thing}, which may run code: refused", fix=REFIX)

    def pop(self) -> Any:
        """The last value."""
        if self.marks and len(self.stack) <= self.marks[-1]:
            raise ValueError("it takes what it has not put there")
        return self.stack.pop()

    def popped_mark(self) -> list[Any]:
        """The values since the last mark."""
        at = self.marks.pop()
        values = self.stack[at:]
        del self.stack[at:]
        return values

    def name(self, path: str) -> None:
        """Put a name there, if it is known."""
        if path not in KNOWN:
            raise self.refused(f"the name {path[:80]}")
        self.stack.append(_Name(KNOWN[path]))

    def call(self) -> None:
        """What a function of a known name makes of its arguments."""
        arguments, function = self.pop(), self.pop()
        if not isinstance(function, _Name) or not isinstance(arguments, tuple):
            raise self.refused("a call")
        self.stack.append(self._made(function, arguments))

    def _made(self, function: _Name, arguments: tuple[Any, ...]) -> Any:
        match str(function), arguments:
            case "array", (_Name(), *_):
                return _Array()
            case "dtype", (str() as code, *_):
                return self._dtype(code)
            case "buffer", (bytes() | bytearray() as raw, np.dtype() as kind, tuple() as shape, str() as order):
                return self._values((0, shape, kind, order == "F", raw))  # type: ignore[reportUnknownArgumentType]
            case "scalar", (np.dtype() as kind, bytes() as raw) if not kind.hasobject:
                return np.frombuffer(raw, kind, 1)[0].item()
            case "encode", (str() as text, "latin1" | "latin-1"):
                return self._claimed(text.encode("latin-1"))
            case "dict", ():
                return {}
            case "dict", (list() as pairs,):
                return _pairs([each for pair in pairs for each in pair])  # type: ignore[reportUnknownVariableType]
            case _:
                raise self.refused(f"a call of {function} with other arguments")

    def _dtype(self, code: str) -> np.dtype[Any]:
        kind = np.dtype(code)
        if kind.kind not in "biufcSUO" or kind.subdtype is not None:
            raise self.refused(f"an array of {code[:40]}")
        return kind

    def build(self) -> None:
        """Give an array or a dtype its state."""
        state, target = self.pop(), self.stack[-1]
        if isinstance(target, _Array):
            target.values = self._values(state)
        elif isinstance(target, np.dtype) and isinstance(state, tuple):
            if len(state) < 2 or state[1] not in ("<", "|", "=", ">") or any(state[2:5]):
                raise self.refused("an unusual type of array")
            ordered = target if state[1] == "|" else target.newbyteorder(state[1])
            for key, value in list(self.memo.items()):
                if value is target:
                    self.memo[key] = ordered
            self.stack[-1] = ordered
        else:
            raise self.refused("the state of an object")

    def _values(self, state: tuple[Any, ...]) -> Any:
        """The values of an array from its version, shape, type, order and content."""
        _, shape, kind, fortran, content = state
        if kind.hasobject:
            flat = _finished(self._claimed(list(content)))
            if math.prod(shape) != len(flat):
                raise ValueError(f"an array of shape {shape} with {len(flat)} objects")
            # An array of dimension 0 holds one object, as `meta` of the datasets does.
            return flat[0] if shape == () else flat
        raw = self._claimed(content.encode("latin-1") if isinstance(content, str) else bytes(content))
        if math.prod(shape) * kind.itemsize != len(raw):
            raise ValueError(f"an array of shape {shape} {kind} with {len(raw)} bytes")
        return np.frombuffer(raw, kind).reshape(shape, order="F" if fortran else "C")

    def _claimed(self, copy: Any) -> Any:
        """The copy itself, once its memory is counted: one word of the pickle may be copied as often as it likes."""
        self.bytes += len(copy) * (8 if isinstance(copy, list) else 1)
        if self.bytes > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES >> 20} MB of copies")
        return copy


def _finished(value: Any) -> Any:
    """A value with its arrays, wherever they are in lists, tuples and dictionaries, each of which is visited once."""
    done: dict[int, tuple[Any, Any]] = {}  # by address; each with the value itself, lest another one gets that address

    def walk(value: Any) -> Any:
        if isinstance(value, _Array):
            return value.values
        if isinstance(value, _Name | np.dtype):
            raise ValueError("a name where a value should be")
        if not isinstance(value, dict | list | tuple):
            return value
        if id(value) in done:  # type: ignore[reportUnknownArgumentType]
            return done[id(value)][1]  # type: ignore[reportUnknownArgumentType]
        if isinstance(value, tuple):
            done[id(value)] = value, tuple(walk(each) for each in value)  # type: ignore[reportUnknownArgumentType]
            return done[id(value)][1]  # type: ignore[reportUnknownArgumentType]
        done[id(value)] = value, value  # type: ignore[reportUnknownArgumentType]
        places = value.items() if isinstance(value, dict) else enumerate(value)  # type: ignore[reportUnknownArgumentType]
        for key, each in list(places):  # type: ignore[reportUnknownVariableType,reportUnknownArgumentType]
            if isinstance(each, _Array | _Name | dict | list | tuple | np.dtype):
                value[key] = walk(each)
        return value  # type: ignore[reportUnknownVariableType]

    return walk(value)


def _set_items(machine: _Machine, values: list[Any]) -> None:
    target = machine.stack[-1]
    if not isinstance(target, dict):
        raise machine.refused("items of an object")
    target.update(_pairs(values))  # type: ignore[reportUnknownMemberType]


def _extend(machine: _Machine, values: list[Any]) -> None:
    target = machine.stack[-1]
    if isinstance(target, set):
        target.update(_keys(values))  # type: ignore[reportUnknownMemberType]
    elif isinstance(target, list):
        target.extend(values)  # type: ignore[reportUnknownMemberType]
    else:
        raise machine.refused("items of an object")


def _stack_name(machine: _Machine, _: Any) -> None:
    name, module = machine.pop(), machine.pop()
    machine.name(f"{module}.{name}")


def _memoize(machine: _Machine, place: int | None) -> None:
    machine.memo[len(machine.memo) if place is None else place] = machine.stack[-1]


def _of_mark(make: Callable[[list[Any]], Any]) -> Callable[[_Machine, Any], None]:
    return lambda machine, _: machine.stack.append(make(machine.popped_mark()))


def _of_last(count: int) -> Callable[[_Machine, Any], None]:
    return lambda machine, _: machine.stack.append(tuple([machine.pop() for _ in range(count)][::-1]))


def _pair_item(machine: _Machine, _: Any) -> None:
    value, key = machine.pop(), machine.pop()
    _set_items(machine, [key, value])


def _one_item(machine: _Machine, _: Any) -> None:
    value = machine.pop()
    _extend(machine, [value])


def _pairs(values: list[Any]) -> dict[Any, Any]:
    return dict(zip(_keys(values[::2]), values[1::2], strict=True))


def _keys(values: list[Any]) -> list[Any]:
    """The same, words and numbers: Python's hash of tuples in tuples may take for ever, or crash."""
    if not all(isinstance(value, str | int | float | bytes | None) for value in values):
        raise ValueError("a key that is no word or number")
    return values


IGNORED = {"PROTO", "FRAME"}
CONSTANTS = {
    *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4", "FLOAT", "BINFLOAT"),
    *("STRING", "BINSTRING", "SHORT_BINSTRING", "UNICODE", "SHORT_BINUNICODE", "BINUNICODE", "BINUNICODE8"),
    *("BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
}
ACTIONS: dict[str, Callable[[_Machine, Any], object]] = {
    "MARK": lambda machine, _: machine.marks.append(len(machine.stack)),
    "POP": lambda machine, _: machine.pop(),
    "POP_MARK": lambda machine, _: machine.popped_mark(),
    "DUP": lambda machine, _: machine.stack.append(machine.stack[-1]),
    "NONE": lambda machine, _: machine.stack.append(None),
    "NEWTRUE": lambda machine, _: machine.stack.append(True),
    "NEWFALSE": lambda machine, _: machine.stack.append(False),
    "EMPTY_DICT": lambda machine, _: machine.stack.append({}),
    "EMPTY_LIST": lambda machine, _: machine.stack.append([]),
    "EMPTY_TUPLE": lambda machine, _: machine.stack.append(()),
    "EMPTY_SET": lambda machine, _: machine.stack.append(set()),
    "DICT": _of_mark(_pairs),
    "LIST": _of_mark(list),
    "TUPLE": _of_mark(tuple),
    "FROZENSET": _of_mark(lambda values: frozenset(_keys(values))),
    "TUPLE1": _of_last(1),
    "TUPLE2": _of_last(2),
    "TUPLE3": _of_last(3),
    "SETITEM": _pair_item,
    "SETITEMS": lambda machine, _: _set_items(machine, machine.popped_mark()),
    "APPEND": _one_item,
    "APPENDS": lambda machine, _: _extend(machine, machine.popped_mark()),
    "ADDITEMS": lambda machine, _: _extend(machine, machine.popped_mark()),
    **dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT", "MEMOIZE"), _memoize),
    **dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), lambda machine, place: machine.stack.append(machine.memo[place])),
    "GLOBAL": lambda machine, names: machine.name(".".join(names.split(" "))),
    "STACK_GLOBAL": _stack_name,
    "REDUCE": lambda machine, _: machine.call(),
    "BUILD": lambda machine, _: machine.build(),
}
