"""Messages between a process and its child: frames over a socket pair, with a deadline on both ends of every frame.

The child is not trusted. Its messages are plain data (numbers, text, bytes, lists, maps, arrays of numbers) that are
decoded without running anything, of a bounded size, and each must answer the request that is open. What travels to
the child is pickled.

NumPy is imported where an array comes, not before: a child without arrays does without it.
"""

import functools
import math
import socket
import struct
import sys
from collections.abc import Callable
from typing import Any, get_args

import msgspec

_LENGTH = struct.Struct(">Q")
_ARRAY = 1
_KINDS = {b"d": 8, b"q": 8, b"?": 1}  # bytes of a number, by its kind as NumPy names it
_MOST_AXES = 8
SLICE = 0.05
Tick = Callable[[], None]
Over = Callable[[], bool]


class WireError(Exception):
    """What came is no message, or none came where one must."""


class ClosedError(WireError):
    """The other end has hung up."""


class LateError(WireError):
    """The deadline has passed."""


def encode(value: Any) -> bytes:
    """Return plain data as bytes; arrays of float64, int64 and bool keep their shape."""
    return msgspec.msgpack.encode(value, enc_hook=_pack)


def decode(data: bytes, kind: Any = Any) -> Any:
    """Return what ``encode`` was given, as a type: one of msgspec's, in which ``NDArray[T]`` is an array of numbers."""
    try:
        return _decoder(kind).decode(data)
    except msgspec.ValidationError as error:
        raise WireError(f"its answer must be of another type: {error}") from None
    except (msgspec.DecodeError, ValueError, RecursionError, OverflowError, struct.error) as error:
        raise WireError(f"a message must be plain data, but is not: {error}") from None


@functools.cache
def _decoder(kind: Any) -> msgspec.msgpack.Decoder[Any]:
    return msgspec.msgpack.Decoder(kind, ext_hook=_unpack, dec_hook=_as_array)


def _as_array(kind: Any, value: Any) -> Any:
    (number,) = get_args(get_args(kind)[1])  # of ``ndarray[shape, dtype[number]]``
    if hasattr(value, "dtype") and value.dtype == number:
        return value
    raise ValueError(f"Expected `array of {number.__name__}`, got `{type(value).__name__}`")


def _pack(value: Any) -> Any:
    np = sys.modules.get("numpy")  # where it was never imported, nothing is an array
    if np is None:
        raise TypeError(f"a message must be plain data, but has a {type(value).__name__}")
    if isinstance(value, np.ndarray) and value.dtype.char in "dlq?":
        kind = {"l": "q"}.get(value.dtype.char, value.dtype.char)
        head = struct.pack(f">cB{value.ndim}Q", kind.encode(), value.ndim, *value.shape)
        return msgspec.msgpack.Ext(_ARRAY, head + np.ascontiguousarray(value).tobytes())
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a message must be plain data, but has a {type(value).__name__}")


def _unpack(code: int, data: memoryview) -> Any:
    if code != _ARRAY or len(data) < 2:
        raise ValueError("an unknown extension")
    kind, axes = struct.unpack_from(">cB", data)
    if kind not in _KINDS or axes > _MOST_AXES:
        raise ValueError("an unknown kind of array")
    shape = struct.unpack_from(f">{axes}Q", data, 2)
    body = data[2 + 8 * axes :]
    if math.prod(shape) * _KINDS[kind] != len(body):
        raise ValueError("an array of another size than it says")
    import numpy as np

    return np.frombuffer(body, kind.decode()).reshape(shape).copy()


def send(link: socket.socket, data: bytes, is_over: Over | None = None, tick: Tick = lambda: None) -> None:
    """Send one frame; ``tick`` is called every ``SLICE`` seconds while waiting."""
    rest = memoryview(_LENGTH.pack(len(data)) + data)
    link.settimeout(None if is_over is None else SLICE)
    while rest:
        try:
            rest = rest[link.send(rest) :]
        except TimeoutError:
            _wait(is_over, tick)
        except OSError:
            raise ClosedError("the other end has hung up") from None


def receive(link: socket.socket, most: int, is_over: Over | None = None, tick: Tick = lambda: None) -> bytes:
    """Return one frame of at most ``most`` bytes; arguments and errors as those of ``send``.

    ``is_over``: whether the time that there was is over; None: it never is.
    """
    (length,) = _LENGTH.unpack(_exactly(link, _LENGTH.size, is_over, tick))
    if length > most:
        raise WireError(f"a message must have at most {most} bytes, but has {length}")
    return bytes(_exactly(link, length, is_over, tick))


def _exactly(link: socket.socket, count: int, is_over: Over | None, tick: Tick) -> bytearray:
    link.settimeout(None if is_over is None else SLICE)
    # Grown as bytes come: a length alone must not take memory.
    data = bytearray()
    while len(data) < count:
        try:
            piece = link.recv(min(count - len(data), 1 << 20))
        except TimeoutError:
            _wait(is_over, tick)
            continue
        except OSError:
            piece = b""
        if not piece:
            raise ClosedError("the other end has hung up")
        data += piece
        if is_over is not None and is_over():
            raise LateError("too late")
    return data


def _wait(is_over: Over | None, tick: Tick) -> None:
    tick()
    if is_over is not None and is_over():
        raise LateError("too late")


def is_pending(link: socket.socket) -> bool:
    """Return whether bytes lie there that nobody has asked for."""
    link.settimeout(0.0)
    try:
        return bool(link.recv(1, socket.MSG_PEEK))
    except (BlockingIOError, TimeoutError):
        return False
    except OSError:
        return False
