"""Compiles designs for microcontrollers, replays their rows in QEMU, compares the estimates with those of this computer
bit by bit, and prints what they cost as a table.

    python3 examples/microcontroller/measure.py            prints the table
    python3 examples/microcontroller/measure.py --write    and writes it into README.md
    python3 examples/microcontroller/measure.py --check    compares one design on two boards with README.md
    python3 examples/microcontroller/measure.py --law      compares the estimates of all shipped designs on a Cortex-M7

It needs the programs qemu-system-arm and qemu-system-riscv32, the targets thumbv7em-none-eabihf and
riscv32imafc-unknown-none-elf of rustup, and its component llvm-tools. A difference of a bit ends it with an error.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FILTER = HERE / "filter"
README = ROOT / "README.md"
DATA = Path(os.environ.get("FUSION_DATA", ROOT.parent / "shared/data"))
BEGIN, END = "<!-- ANCHOR: cost -->", "<!-- ANCHOR_END: cost -->"

HEAD = [
    "design", "processor", "flash kB", "RAM kB", "stack kB: assembling", "running", "10³ instructions a row: input", "others", "worst row",
    "allocations later", "calls of panic",
]
#: The columns that may not grow unseen.
LIMITED = ["flash kB", "RAM kB", "stack kB: assembling", "running", "10³ instructions a row: input", "worst row", "allocations later"]

SCALE = '{ estimate = true, initial = [0, 0, 0], sigma = "0.5 %" }'

#: What it is, and the design with its changes.
DESIGNS = {
    "15 states: strapdown, GNSS": ("configs/ins-gps.toml", ["simulation.draw_start=false"]),
    "21 states: the same with scale factors": (
        "configs/ins-gps.toml",
        ["simulation.draw_start=false", f"process.gyro.scale={SCALE}", f"process.accelerometer.scale={SCALE}"],
    ),
    "6 states: attitude, compass": ("examples/microcontroller/designs/attitude.toml", []),
    "19 states: dead reckoning, USBL": ("configs/utv-square.toml", ["simulation.draw_start=false"]),
}

ARM = "thumbv7em-none-eabihf"
RISC_V = "riscv32imafc-unknown-none-elf"
BOARDS = {
    "Cortex-M7": (ARM, "cortex-m7", ["qemu-system-arm", "-M", "mps2-an500", "-cpu", "cortex-m7"]),
    "Cortex-M4F": (ARM, "cortex-m4", ["qemu-system-arm", "-M", "mps2-an386", "-cpu", "cortex-m4"]),
    "RISC-V": (RISC_V, None, ["qemu-system-riscv32", "-M", "virt", "-m", "64M", "-bios", "none"]),
}


def run(*command: str, **more) -> str:
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False, **more)
    if done.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{done.stdout}failed with exit code {done.returncode}")
    return done.stdout


def compile_design(fusion: str, path: Path, changes: list[str]) -> str | None:
    """Writes the crate and its rows. Returns the number and hash of the estimates on this computer, with `libm`; nothing
    for a design that is refused."""
    shutil.rmtree(FILTER, ignore_errors=True)
    settings = [word for change in changes for word in ("--set", change)]
    # The files of the other designs are in the folder of the design.
    data = ["--data", str(DATA)] if DATA.is_dir() and "real" in path.parts else []
    command = [fusion, "compile", str(path), "--rows", "--out", str(FILTER), "--crates", str(ROOT), *settings, *data]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        print(f"{path.relative_to(ROOT)}: {done.stderr.splitlines()[0]}", flush=True)
        return None
    with open(FILTER / "rows.bin", "rb") as rows:
        target = {**os.environ, "CARGO_TARGET_DIR": str(HERE / "target/host")}
        return run("cargo", "run", "--quiet", "--release", "--example", "replay", cwd=FILTER, stdin=rows, env=target).strip()


def replay(board: str, profile: dict[str, str], folder: Path = HERE) -> tuple[Path, dict[str, list[str]]]:
    """The program of a folder for a board, and what it prints there, by its first word. It reads the rows of the filter."""
    triple, processor, emulator = BOARDS[board]
    target = folder / "target" / (processor or "riscv")
    environment = {**os.environ, **profile, "CARGO_TARGET_DIR": str(target)}
    # Joined with the flags of `.cargo/config.toml`; the variable RUSTFLAGS would replace them.
    flags = ["--config", f"target.{triple}.rustflags=['-C', 'target-cpu={processor}']"] if processor else []
    run("cargo", "build", "--quiet", "--release", "--target", triple, *flags, cwd=folder, env=environment)
    program = target / triple / "release/microcontroller"
    semihosting = ["-nographic", "-semihosting-config", "enable=on,target=native", "-icount", "shift=0"]
    printed = run(*emulator, *semihosting, "-kernel", str(program), cwd=FILTER, timeout=3600)
    facts: dict[str, list[str]] = {}
    for line in printed.splitlines():
        word, *rest = line.split()
        facts.setdefault(word, []).append(" ".join(rest))
    return program, facts


def compare(name: str, board: str, facts: dict[str, list[str]], expected: str) -> None:
    if facts.get("estimates") != [expected]:
        sys.exit(f"{name} on {board}: estimates {facts.get('estimates')}, on this computer {expected}")


def law(fusion: str) -> None:
    """All shipped designs: built soon, not small, since this changes no bit. Four hours take an hour: five minutes."""
    soon = {"CARGO_PROFILE_RELEASE_LTO": "off", "CARGO_PROFILE_RELEASE_CODEGEN_UNITS": "16"}
    compared = 0
    for path in sorted((ROOT / "configs").rglob("*.toml")):
        text = path.read_text()
        if "[process]" not in text or "parts" in path.parts:
            continue
        changes = ["simulation.draw_start=false"] if "[simulation" in text else []
        changes += ["simulation.longest=300"] if "sea-trial" in path.name else []
        expected = compile_design(fusion, path, changes)
        if expected is None:
            continue
        _, facts = replay("Cortex-M7", soon)
        compare(path.name, "Cortex-M7", facts, expected)
        compared += 1
        print(f"{path.relative_to(ROOT)}: {expected}, equal", flush=True)
    print(f"{compared} designs have equal bits")


def measure(board: str, profile: dict[str, str] | None = None, folder: Path = HERE) -> dict[str, list[str]]:
    """What the program prints on a board, and its size."""
    program, facts = replay(board, profile or {}, folder)
    tools = Path(run("rustc", "--print", "sysroot").strip()).glob("lib/rustlib/*/bin")
    tools = next((folder for folder in tools if (folder / "llvm-size").exists()), None)
    if tools is None:
        sys.exit("`llvm-size` is missing: rustup component add llvm-tools")
    sizes = re.findall(r"^(\S+) +(\d+) ", run(str(tools / "llvm-size"), "-A", str(program)), re.M)
    size = {name: int(bytes) for name, bytes in sizes}
    facts["flash"] = [str(sum(size.get(name, 0) for name in (".vector_table", ".text", ".rodata", ".data")))]
    # Without the block of the heap, which has a reserve.
    room = int(facts["heap"][0].split()[2]) if "heap" in facts else 0
    facts["static"] = [str(size.get(".data", 0) + size.get(".bss", 0) - room)]
    assembly = run(str(tools / "llvm-objdump"), "-d", "--demangle", "--no-show-raw-insn", str(program))
    # Branches, with or without a link, to functions that panic.
    branch = r"\t(?:bl?|blx|b\.w|jal|jalr|j|call|tail)\b.*<(?:core::(?:panicking|cell::panic\w*|option::\w*fail\w*|result::\w*fail\w*|slice::\w+::\w*fail\w*)|alloc::\w+::\w*(?:error|overflow))"
    facts["panics"] = [str(len(re.findall(branch, assembly)))]
    return facts


def row(name: str, board: str, facts: dict[str, list[str]]) -> str:
    """A row of the table."""
    streams = [line.split() for line in facts["rows"]]
    # The input is the stream with the most rows.
    inputs = max(streams, key=lambda stream: int(stream[1]))
    others = [stream for stream in streams if stream is not inputs]
    thousand = lambda number: f"{int(number) / 1000:.0f}"
    updates = ", ".join(f"{stream[0]} {thousand(stream[2])}" for stream in others)
    worst = thousand(max(int(stream[3]) for stream in streams))
    heap = int(facts["heap"][0].split()[1])
    stacks = [int(bytes) for bytes in facts["stack"][0].split()]
    memory = (heap + int(facts["static"][0]) + max(stacks)) / 1000
    cells = [
        name, board, thousand(facts["flash"][0]), f"{memory:.0f}", *(f"{stack / 1000:.1f}" for stack in stacks), thousand(inputs[2]), updates, worst,
        facts["allocations"][0], facts["panics"][0],
    ]
    return f"| {' | '.join(cells)} |"


def written() -> list[list[str]]:
    """The rows of the table in README.md, as cells."""
    text = README.read_text()
    table = text[text.index(BEGIN) : text.index(END)]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines() if line.startswith("|")]


def check(found: str) -> None:
    """Compares a row with that of README.md. The compiler may be another one: 5 %."""
    cells = [cell.strip() for cell in found.strip("|").split("|")]
    known = next((row for row in written() if row[:2] == cells[:2]), None)
    if known is None:
        sys.exit(f"README.md has no row {cells[:2]}: run this program with --write")
    for name, now, before in zip(HEAD, cells, known):
        if name in LIMITED and float(now) > 1.05 * float(before):
            sys.exit(f"{' on '.join(cells[:2])}: {name} is {now}, and README.md has {before}")


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("--check", action="store_true", help="compares one design on two boards with README.md")
    arguments.add_argument("--write", action="store_true", help="writes the table into README.md")
    arguments.add_argument("--law", action="store_true", help="compares the estimates of all shipped designs")
    arguments.add_argument("--fusion", default=str(ROOT / "target/release/fusion"), help="the program `fusion`")
    given = arguments.parse_args()
    if given.law:
        law(given.fusion)
        return
    lines = [f"| {' | '.join(HEAD)} |", "|" + "---|" * len(HEAD)]
    print(*lines, sep="\n")
    for name, (design, changes) in list(DESIGNS.items())[: 1 if given.check else None]:
        expected = compile_design(given.fusion, ROOT / design, changes)
        if expected is None:
            sys.exit(1)
        for board in ["Cortex-M7", "RISC-V"] if given.check else BOARDS:
            facts = measure(board)
            compare(name, board, facts, expected)
            lines.append(row(name, board, facts))
            print(lines[-1], flush=True)
            if given.check:
                check(lines[-1])
    if given.write:
        text = README.read_text()
        begin, end = text.index(BEGIN) + len(BEGIN), text.index(END)
        README.write_text(text[:begin] + "\n" + "\n".join(lines) + "\n" + text[end:])


if __name__ == "__main__":
    main()
