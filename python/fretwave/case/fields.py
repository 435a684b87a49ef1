"""Kinds of values that keys of a case file take, and how a key is written with its doc, unit and default."""

from __future__ import annotations

from typing import Annotated, Any, Union

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, WithJsonSchema
from pydantic_core import PydanticKnownError

from ..given import LARGEST
from ..units import SYSTEMS

#: Longest name: results are files of that name, whose systems allow 255 characters with all that is added.
LONGEST_NAME = 100
LARGEST_WHOLE = 2**31 - 1


def _of_the_core(value: int) -> int:
    """Whole numbers have 32 bits in the core; harmonics, sectors and points beyond are a slip."""
    if value > LARGEST_WHOLE:
        raise PydanticKnownError("less_than_equal", {"le": LARGEST_WHOLE})
    if value < -LARGEST_WHOLE:
        raise PydanticKnownError("greater_than_equal", {"ge": -LARGEST_WHOLE})
    return value


Whole = Annotated[int, AfterValidator(_of_the_core)]
Counted = Annotated[Whole, Field(ge=1)]
Dof = Annotated[
    str,
    BeforeValidator(lambda value: str(value) if type(value) is int else value),
    WithJsonSchema({"type": ["string", "integer"]}),
    Field(pattern=r"^[^\x00-\x1f\x7f]{1,100}$"),
]
UnitName = Annotated[str, WithJsonSchema({"type": "string", "enum": list(SYSTEMS)})]
Name = Annotated[str, Field(max_length=LONGEST_NAME)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
#: Of a motion or what drives it, with a square that is a number.
Size = Annotated[float, Field(gt=0, le=LARGEST, allow_inf_nan=False)]
#: In Hz: equations have its square, times that of an order.
Frequency = Annotated[float, Field(gt=0, le=1e100)]
#: In rev/min: stiffness and loads have the square of two such in proportion.
SLOWEST, FASTEST = 1e-30, 1e30


def _with_a_square(speed: float) -> float:
    if 0 < speed < SLOWEST:
        raise PydanticKnownError("greater_than_equal", {"ge": SLOWEST})
    return speed


Speed = Annotated[float, Field(gt=0, le=FASTEST), AfterValidator(_with_a_square)]
SpeedOrRest = Annotated[float, Field(ge=0, le=FASTEST), AfterValidator(_with_a_square)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
#: A number that is none is told by its row and column.
Matrix = Union[str, list[list[Annotated[float, Field(allow_inf_nan=True)]]]]
LoadVector = Union[str, list[Finite]]
Ratio = Annotated[float, Field(ge=0, lt=1, allow_inf_nan=False)]
ByMode = Union[Ratio, Annotated[list[Ratio], Field(min_length=1)], Annotated[dict[str, Ratio], Field(min_length=1)]]
Quality = Annotated[float, Field(gt=0.5, allow_inf_nan=False)]
QByMode = Union[
    Quality, Annotated[list[Quality], Field(min_length=1)], Annotated[dict[str, Quality], Field(min_length=1)]
]
Deviations = Annotated[list[Annotated[float, Field(gt=-1, allow_inf_nan=False)]], Field(min_length=2)]


def key(doc: str, unit: str | None = None, example: str | None = None, **rules: Any) -> Any:
    """A field with its doc, unit and a line of TOML that shows it."""
    extra: dict[str, Any] = {"unit": unit, "example": example}
    return Field(description=doc, json_schema_extra=extra, **rules)


class Section(BaseModel):
    """A table of the case file: no unknown keys, no silent conversion of types, no number that is not finite."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
