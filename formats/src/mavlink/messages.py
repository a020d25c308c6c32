"""Writes messages.txt from the definitions of MAVLink (pymavlink 2.4.50 has them in dialects/v20).

    python3 messages.py dialects/v20/ardupilotmega.xml > messages.txt

The definitions that a file includes are read too. The fields keep their order, which is not that of a frame.
"""

import pathlib
import re
import textwrap
import xml.etree.ElementTree as xml

import sys


def read(path, found):
    root = xml.parse(path).getroot()
    for include in root.findall("include"):
        read(path.parent / include.text.strip(), found)
    found.update((int(message.get("id")), message) for message in root.iter("message"))


def field(definition):
    of, length = re.fullmatch(r"(\w+?)(?:\[(\d+)\])?", definition.get("type")).groups()
    if of in ("float", "double"):
        form = {"float": "R4", "double": "R8"}[of]
    elif of == "char":
        form = "C"
    else:
        sign, bits = re.match(r"(u?)int(\d+)_t", of).groups()
        form = ("U" if sign else "I") + str(int(bits) // 8)
    unit = definition.get("units")
    assert unit is None or " " not in unit
    return f"{definition.get('name')}:{form}" + (f"x{length}" if length else "") + (f"[{unit}]" if unit else "")


def line(number, message):
    parts = {"field": field, "extensions": lambda _: "+"}
    words = [str(number), message.get("name")] + [parts[part.tag](part) for part in message if part.tag in parts]
    return textwrap.fill(" ".join(words), 120, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)


found = {}
read(pathlib.Path(sys.argv[1]), found)
print("\n".join(line(number, found[number]) for number in sorted(found)))
