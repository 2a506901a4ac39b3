"""Whole numbers as people write them on a command line: 1000, 2_000_000, 1e6, 1.5e6."""

from __future__ import annotations

from decimal import Decimal, InvalidOperation
from typing import Annotated, Any

from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo


def read_whole_number(text: str) -> int:
    """The number that a text stands for, exactly. Raises ValueError unless it is whole and of at most 18 digits."""
    try:
        number = Decimal(text)
    except InvalidOperation:
        raise ValueError(f"must be a whole number, as 1000, 2_000_000 or 1.5e6, got {text!r}") from None
    if not number.is_finite() or (number and not 0 <= number.adjusted() < 18) or number != number.to_integral_value():
        raise ValueError(f"must be a whole number of at most 18 digits, got {text!r}")
    return int(number)


def _specify(*, optional: bool) -> PrimitiveConstructorSpec[Any]:
    return PrimitiveConstructorSpec(
        nargs=1,
        metavar="N",
        instance_from_str=lambda texts: read_whole_number(texts[0]),
        is_instance=lambda value: (optional and value is None) or (isinstance(value, int) and not isinstance(value, bool)),
        str_from_instance=lambda value: [str(value)],
    )


# Types of a command's fields. The second is no union with the first: of a union tyro's error would show the machinery.
WholeNumber = Annotated[int, _specify(optional=False)]
OptionalWholeNumber = Annotated[int | None, _specify(optional=True)]

NUMBERS = ConstructorRegistry()  # with it in force, plain int and float fields of any command read so and say N and X in the help


@NUMBERS.primitive_rule
def _read_plain(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    if info.type is int or info.type == int | None:
        return _specify(optional=info.type is not int)
    if info.type is float or info.type == float | None:
        optional = info.type is not float
        return PrimitiveConstructorSpec(
            nargs=1,
            metavar="X",
            instance_from_str=lambda texts: float(texts[0]),
            is_instance=lambda value: (optional and value is None) or isinstance(value, (int, float)),
            str_from_instance=lambda value: [str(value)],
        )
    return None
