"""Writes lib/fusion/types.py: the tables of designs and of results, from their JSON Schemas.

python tables.py     (after `fusion schema`, see schema/)
"""

from __future__ import annotations

import json
import keyword
import re
import textwrap
from pathlib import Path
from typing import Any

Schema = dict[str, Any]
HERE = Path(__file__).parent
WIDTH = 120
HEAD = '''"""Tables of designs and results, for type checkers and editors.

`DesignTable` has the keys of a design, as ``set`` takes them: a number is SI, a text has a unit. `Summary` has the keys of
`Result.summary`. Written by python/tables.py from the JSON Schemas of the program.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Union

Numbers = Union[list[float], list[Union[float, str]]]
'''
# Forms of a number: with or without unit, one or several.
SCALAR, ARRAY = {"float", "int", "str"}, "Numbers"
# The name of a table that many blocks have, by its description.
NAMES = {"The table form of a parameter.": "Parameter"}


class Tables:
    """Classes made of the definitions of one schema."""

    def __init__(self, schema: Schema, prefix: str, is_total: bool):
        self.defs = schema["$defs"]
        self.prefix = prefix
        self.is_total = is_total
        self.classes: dict[str, str] = {}
        self.named: dict[str, str] = {}

    def type(self, schema: object, name: str) -> set[str]:
        """The alternatives of a value. `name` is that of a new class."""
        if not isinstance(schema, dict) or not schema:
            return {"Any"}
        if "$ref" in schema:
            ref = schema["$ref"].rsplit("/", 1)[1]
            return self.type(self.defs[ref], camel(ref))
        # An alternative without a condition only leads editors. The alternatives repeat what follows an `if`.
        parts = [part for key in ("anyOf", "oneOf") for part in schema.get(key, ()) if part.keys() - {"description"}]
        if len(parts) == 2 and {"type": "null"} in parts:
            return self.type(next(part for part in parts if part != {"type": "null"}), name) | {"None"}
        fields: dict[str, list[Any]] = {}
        for part in [schema, *parts]:
            for key, field in self.fields(part).items():
                fields.setdefault(key, []).append(field)
        if fields:
            with_fields = [part for part in [schema, *parts] if self.fields(part)]
            found = {self.table(name, fields, with_fields[0] if len(with_fields) == 1 else schema)}
            for part in parts:
                if not self.fields(part):
                    found |= self.type(part, name)
            return found
        if parts:
            return set().union(*(self.type(part, name) for part in parts))
        if "const" in schema:
            return {literal(schema["const"])}
        if "enum" in schema:
            return {literal(*schema["enum"])}
        kinds = schema.get("type", [])
        return set().union(*(self.kind(kind, schema, name) for kind in ([kinds] if isinstance(kinds, str) else kinds))) or {"Any"}

    def fields(self, schema: Schema) -> Schema:
        """The keys of a table."""
        if "$ref" in schema:
            return self.fields(self.defs[schema["$ref"].rsplit("/", 1)[1]])
        found = dict(schema.get("properties", {}))
        for part in schema.get("allOf", ()):
            if "if" not in part:
                found |= self.fields(part)
        return found

    def kind(self, kind: str, schema: Schema, name: str) -> set[str]:
        if kind == "object":
            inner = schema.get("additionalProperties")
            if isinstance(inner, dict) and "not" not in inner:
                return {f"dict[str, {union(self.type(inner, name))}]"}
            return {"dict[str, Any]"}
        if kind == "array":
            if isinstance(schema.get("prefixItems"), list):
                return {"list[Any]"}
            inner = self.type(schema.get("items"), name)
            return {ARRAY} if inner <= SCALAR and "float" in inner else {f"list[{union(inner)}]"}
        return {{"number": "float", "integer": "int", "string": "str", "boolean": "bool", "null": "None"}[kind]}

    def table(self, name: str, fields: dict[str, list[Any]], schema: Schema) -> str:
        """A class of these keys; equal ones are one class."""
        key = json.dumps([sorted(fields), [bare(part) for _, part in sorted(fields.items())]], sort_keys=True)
        if key in self.named:
            return self.named[key]
        own = self.prefix + NAMES.get(schema.get("description", ""), name)
        same = sum(known.rstrip("0123456789") == own for known in self.classes)
        own += str(same + 1) if same else ""
        self.named[key] = own
        self.classes[own] = ""
        types = {
            field: union(set().union(*(self.type(part, name + camel(field)) for part in fields[field]))) for field in sorted(fields)
        }
        doc = "\n    ".join(textwrap.wrap(first_sentence(schema.get("description", "")), WIDTH - 10))
        if any(keyword.iskeyword(field) for field in types):
            lines = [f'    "{field}": "{kind}",\n' for field, kind in types.items()]
            total = "" if self.is_total else ", total=False"
            self.classes[own] = f'{own} = TypedDict(\n    "{own}",\n    {{\n{textwrap.indent("".join(lines), "    ")}    }}{total},\n)\n'
            return own
        text = f"class {own}(TypedDict{'' if self.is_total else ', total=False'}):\n"
        text += f'    """{doc}"""\n\n' if doc else ""
        self.classes[own] = text + "\n".join(wrapped(f"    {field}: {kind}") for field, kind in types.items()) + "\n"
        return own


def camel(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in re.split(r"[._]", name))


def literal(*values: object) -> str:
    return f"Literal[{', '.join(repr(value) for value in values)}]"


def union(types: set[str]) -> str:
    """One type of the alternatives."""
    if "Any" in types:
        return "Any"
    texts = sorted({value for kind in types if kind.startswith("Literal") for value in kind[8:-1].split(", ")})
    if "str" in types:
        texts = []
    types = {kind for kind in types if not kind.startswith("Literal")} | ({f"Literal[{', '.join(texts)}]"} if texts else set())
    if "float" in types:
        types.discard("int")
    return " | ".join(sorted(types - {"None"})) + (" | None" if "None" in types else "")


def wrapped(line: str) -> str:
    if len(line) <= WIDTH:
        return line
    name, kind = line.split(": ", 1)
    return f"{name}: (\n" + textwrap.indent("\n| ".join(kind.split(" | ")), " " * 8) + "\n    )"


def first_sentence(text: str) -> str:
    text = " ".join(text.replace("\\", "").split())
    return re.split(r"(?<=[.]) ", text)[0]


def bare(schema: object) -> object:
    """The schema without what does not change its type."""
    if isinstance(schema, list):
        return [bare(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    told = {"description", "examples", "default", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "format", "title"}
    return {key: bare(value) for key, value in schema.items() if key not in told or isinstance(value, dict)}


def written() -> str:
    """The module."""
    design, summary = (json.loads((HERE.parent / "schema" / f"{name}.schema.json").read_text()) for name in ("fusion", "summary"))
    tables = Tables(design, "", is_total=False)
    whole = design["$defs"]["design"]["properties"]
    tables.table("DesignTable", {key: [schema] for key, schema in whole.items()}, {"description": "The keys of a design."})
    results = Tables(summary, "Summary", is_total=True)
    results.table("", {key: [schema] for key, schema in summary["properties"].items()}, summary)
    return HEAD + "".join(f"\n\n{text}" for text in [*tables.classes.values(), *results.classes.values()])


if __name__ == "__main__":
    (HERE / "lib" / "fusion" / "types.py").write_text(written())
