"""Functions of a model, called by their address: one compiled core serves them all, also those that a user writes.

A model (a sensor, a motion, a term of the reward) brings small functions of agreed signatures. Each is compiled by itself and
cached; the core finds its address among its parameters and calls it. So no model makes the core compile anew, and a call costs a
few nanoseconds. Addresses hold for one process: they never go into a file or a pickle.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from tagtrack.envs.kernels.compiling import FAST_MATHS, compiled, mark_foreign
from tagtrack.envs.kernels.turns import turn_of_callback

ROW = 80  # parameters of a model at most; they travel as one row of so many

number = types.float64
whole = types.int64
word = types.uint64
single = types.float32
numbers = types.Array(types.float64, 1, "C")
singles = types.Array(types.float32, 1, "C")
rows = types.Array(types.float32, 2, "C")
table = types.Array(types.float64, 2, "C")
wholes = types.Array(types.int64, 1, "C")
bits = types.Array(types.int32, 1, "C")
nothing = types.void


def record_of(dtype: np.dtype) -> Any:
    """A record of a structured dtype, as an argument."""
    return numba.from_dtype(dtype)


class Signature:
    """What a function of a model is given and gives back.

    Args:
        name: what the function does. returns: numba type. arguments: name -> numba type, in order.
    """

    def __init__(self, name: str, returns: Any, **arguments: Any) -> None:
        self.name = name
        self.arguments = arguments
        self.type = returns(*arguments.values())
        self.at = _function_at(types.FunctionType(self.type))

    def __repr__(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"


def _function_at(function_type: Any) -> Any:
    """The intrinsic that makes a callable of an address (int64) in compiled code."""

    @intrinsic
    def function_at(typing_context: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            function = cgutils.create_struct_proxy(function_type)(context, builder)
            null = cgutils.get_null_value(cgutils.voidptr_t)
            function.c_addr = builder.inttoptr(arguments[0], cgutils.voidptr_t)
            function.py_addr = null
            function.jit_addr = null
            return function._getvalue()

        return function_type(types.int64), generate

    return function_at


class Native:
    """A function of a model, compiled when its address is first asked for. Calling it runs it (from Python: for tests).

    Raises:
        ValueError: where the function takes other arguments than its signature says.
    """

    def __init__(self, function: Callable[..., Any], signature: Signature) -> None:
        given = [name for name in inspect.signature(function).parameters]
        if len(given) != len(signature.arguments):
            raise ValueError(
                f"{_name(function)} must take {len(signature.arguments)} arguments, {signature!r}, got ({', '.join(given)})"
            )
        self.function = function
        self.signature = signature
        self._code: Any = None
        self._callable: Any = None
        mark_foreign(function)

    @property
    def address(self) -> int:
        """Where the compiled code lies; it stays there as long as this object lives."""
        if self._code is None:
            self._code = self._compile()
        return int(self._code.address)

    def _compile(self) -> Any:
        options: dict[str, Any] = {"fastmath": FAST_MATHS, "error_model": "numpy"}
        try:
            try:
                with turn_of_callback(self.function, self.signature.type):
                    return numba.cfunc(self.signature.type, cache=True, **options)(self.function)
            except RuntimeError:  # no file to cache beside: a notebook, a string
                return numba.cfunc(self.signature.type, **options)(self.function)
        except Exception as error:  # numba's own, and a KeyError where a record has no such field
            why = " ".join(str(error).split())
            raise ValueError(f"{_name(self.function)} cannot be compiled as {self.signature!r}: {why}") from error

    def __call__(self, *arguments: Any) -> Any:
        if self._callable is None:
            self._callable = compiled(self.function)
        return self._callable(*arguments)

    def __repr__(self) -> str:
        return f"{_name(self.function)} as {self.signature!r}"


def _name(function: Callable[..., Any]) -> str:
    return f"{function.__module__}.{getattr(function, '__qualname__', function)}"


def native(signature: Signature) -> Callable[[Callable[..., Any]], Native]:
    """Decorator: this function is one of a model's, called by its address."""
    return lambda function: Native(function, signature)


def address_of(function: Native | None) -> int:
    """0 where there is none: whoever calls asks first."""
    return 0 if function is None else function.address


def require_functions(model: type, **wanted: Signature) -> None:
    """Refuse a model whose functions have another signature than the place they stand in.

    Raises:
        TypeError: naming the model, the function and what it should be.
    """
    for name, signature in wanted.items():
        function = getattr(model, name, None)
        if function is None:
            continue
        if not isinstance(function, Native):
            raise TypeError(f"{model.__name__}.{name} must be decorated as the model's {signature!r}, got {function!r}")
        if function.signature is not signature:
            raise TypeError(f"{model.__name__}.{name} must be {signature!r}, got {function!r}")
