"""The JSON schema of a case file, from which editors complete keys and underline what is wrong.

Shipped as ``case.schema.json`` beside this file; ``fretwave check --schema`` prints it, with the kinds and laws of a
case's plug-ins. A line ``#:schema <path of that file>`` at the top of a case tells an editor.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

from ..registry import kinds
from ..units import quantity
from .contact_parameters import PER_AREA, has_per_area
from .pair_values import TABLE
from .schema import (
    TOP_LEVEL,
    AerodynamicsSection,
    ContactSection,
    DampingSection,
    GaugeSection,
    MaterialSection,
    ModelSection,
    PreloadSection,
    ReductionSection,
    StudySection,
    UncertaintySection,
)

if TYPE_CHECKING:
    from ..model.law_info import LawInfo, ParameterInfo

#: The schema that is shipped: of the package's own analyses and laws.
SHIPPED = Path(__file__).with_name("case.schema.json")
SECTIONS: Mapping[str, type[BaseModel]] = {
    "model": ModelSection,
    "reduction": ReductionSection,
    "preload": PreloadSection,
    "damping": DampingSection,
    "aerodynamics": AerodynamicsSection,
    "material": MaterialSection,
    "uncertainty": UncertaintySection,
    "study": StudySection,
}
Schema = dict[str, Any]
#: Bounds as pydantic writes them of a value that is checked beyond its type -> keywords of JSON schema.
BOUNDS = {"ge": "minimum", "le": "maximum", "gt": "exclusiveMinimum", "lt": "exclusiveMaximum"}


def json_schema(laws: Mapping[str, LawInfo]) -> Schema:
    """The schema (JSON Schema 2020-12) with these laws and all kinds of analyses known now."""
    definitions: Schema = {}
    properties: Schema = {name: {"description": text} for name, text in TOP_LEVEL.items()}
    for name, section in SECTIONS.items():
        properties[name].update(_section(section, definitions))
    properties["title"]["type"] = "string"
    properties["plugins"].update(type="array", items={"type": "string"})
    properties["contact"].update(type="array", items=_contact(laws, definitions))
    properties["gauge"].update(type="array", items=_section(GaugeSection, definitions))
    properties["analysis"].update(type="array", minItems=1, items=_analysis(definitions))
    properties["quick"]["type"] = "object"
    found = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "A case of fretwave",
        "type": "object",
        "properties": properties,
        "required": ["model", "analysis"],
        "additionalProperties": False,
        "$defs": definitions,
    }
    return {name: _with_bounds(part) for name, part in found.items()}


def _with_bounds(part: object) -> object:
    """The same with bounds under names that JSON schema knows."""
    if isinstance(part, list):
        return [_with_bounds(one) for one in part]
    if not isinstance(part, dict):
        return part
    numbers = {name for name in BOUNDS if isinstance(part.get(name), (int, float))}
    return {BOUNDS[key] if key in numbers else key: _with_bounds(value) for key, value in part.items()}


def json_text(laws: Mapping[str, LawInfo]) -> str:
    """`json_schema` as text."""
    return json.dumps(json_schema(laws), indent=1) + "\n"


def _section(section: type[BaseModel], definitions: Schema) -> Schema:
    """Schema of a table; the tables in it go to the definitions."""
    schema = section.model_json_schema()
    definitions.update({name: _plain(nested) for name, nested in schema.pop("$defs", {}).items()})
    return _plain(schema)


def _plain(schema: Schema) -> Schema:
    """As editors want it: units in the descriptions, and no null, which TOML has not."""
    schema = {key: value for key, value in schema.items() if key not in ("title", "example")}
    unit = schema.pop("unit", None)
    if unit:
        schema["description"] = f"{schema['description']} [{unit}]"
    if "default" in schema and schema["default"] is None:
        del schema["default"]
    choices = [choice for choice in schema.get("anyOf", ()) if choice != {"type": "null"}]
    if len(choices) == 1:
        schema = {**choices[0], **{key: value for key, value in schema.items() if key != "anyOf"}}
    elif choices:
        schema["anyOf"] = choices
    if "properties" in schema:
        schema["properties"] = {name: _plain(value) for name, value in schema["properties"].items()}
    return schema


def _analysis(definitions: Schema) -> Schema:
    """One of the kinds, told by its `type`: a wrong key is then a key of that kind."""
    for name, kind in kinds().items():
        definitions[f"analysis {name}"] = _section(kind, definitions)
    branches = [
        {
            "if": {"properties": {"type": {"const": name}}, "required": ["type"]},
            "then": {"$ref": f"#/$defs/analysis {name}"},
        }
        for name in kinds()
    ]
    return {"type": "object", "required": ["type"], "properties": {"type": {"enum": list(kinds())}}, "allOf": branches}


def _contact(laws: Mapping[str, LawInfo], definitions: Schema) -> Schema:
    """The keys of every contact, and the parameters of the law that it names."""
    schema = _section(ContactSection, definitions)
    schema["properties"]["law"] = {**schema["properties"]["law"], "enum": list(laws)}
    own = schema["properties"]
    schema["allOf"] = [
        {
            "if": {"properties": {"law": {"const": name}}, "required": ["law"]},
            "then": {"properties": {**dict.fromkeys(own, True), **_parameters(law)}, "additionalProperties": False},
        }
        for name, law in laws.items()
    ]
    return schema


def _parameters(law: LawInfo) -> Schema:
    return {
        name: _parameter(parameter, per_area)
        for parameter in law.parameters
        for name, per_area in ((parameter.name, ""), (parameter.name + PER_AREA, " per area"))
        if not per_area or has_per_area(parameter)
    }


def _parameter(parameter: ParameterInfo, per_area: str) -> Schema:
    """A number, or one for each pair, as they are or in a table."""
    number: Schema = {"type": "number"}
    table: Schema = {"type": "string", "pattern": rf"\{TABLE}$"}
    if parameter.lower > -1e300:
        number["exclusiveMinimum" if parameter.strict else "minimum"] = parameter.lower
    text = f"{parameter.doc}{per_area} [{quantity(parameter.unit)}{'/length^2' if per_area else ''}]"
    return {"description": text, "anyOf": [number, {"type": "array", "items": number, "minItems": 1}, table]}
