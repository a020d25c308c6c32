#!/usr/bin/env python3
"""Compares this project with others' programs and writes the results into the book, `book/src/beside-others.md`.

    benches/peers/run.py                    every peer
    benches/peers/run.py --only fusion-nav  one of them
    benches/peers/run.py --list             their names

Others' programs come from crates.io and PyPI into `target/peers`. A peer that cannot be had is reported, and its part
of the chapter stays as it is. FUSION names the command of this project, otherwise it is built. FUSION_DATA names the
folder of the public data sets.
"""

import argparse
import importlib
import os
import re
import subprocess
import sys
import venv

sys.dont_write_bytecode = True
import common  # noqa: E402

CHAPTER = common.ROOT / "book" / "src" / "beside-others.md"
# The name of a peer, and the module that compares with it.
PEERS = {
    "fusion-nav": "flights",
    "fusion-nav-small": "microcontroller",
    "ekf2": "autopilot",
    "attitude": "attitude",
    "robots": "robots",
    "gtsam": "graphs",
    "published": "published",
}


def enter_environment():
    """Continues in the Python environment of the comparisons, and makes it first."""
    folder = common.PEERS / "venv"
    python = folder / "bin" / "python"
    if os.path.realpath(sys.prefix) == os.path.realpath(folder):
        return
    if not python.exists():
        common.say(f"making {folder}")
        venv.create(folder, with_pip=True)
    sys.exit(subprocess.run([python, __file__, *sys.argv[1:]]).returncode)


def write(name, text):
    """Replaces the part of a peer in the chapter."""
    chapter = CHAPTER.read_text()
    first, last = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    part = re.compile(re.escape(first) + ".*?" + re.escape(last), re.DOTALL)
    if not part.search(chapter):
        sys.exit(f"{CHAPTER}: no part between `{first.strip()}` and `{last}`")
    CHAPTER.write_text(part.sub(lambda _: f"{first}{text.strip()}\n{last}", chapter))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=PEERS, help="one peer")
    parser.add_argument("--seeds", type=int, default=20, help="seeds of each simulated flight")
    parser.add_argument("--scenario", help="fly this scenario of fusion-nav, and take the others from the last time")
    parser.add_argument("--list", action="store_true", help="print the names of the peers")
    options = parser.parse_args()
    if options.list:
        print("\n".join(PEERS))
        return 0
    enter_environment()
    common.PEERS.mkdir(parents=True, exist_ok=True)
    missing = 0
    for name in [options.only] if options.only else PEERS:
        common.say(name)
        try:
            write(name, importlib.import_module(PEERS[name]).compare(options))
        except common.Missing as reason:
            missing += 1
            print(f"{name}: not compared: {reason}", file=sys.stderr)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
