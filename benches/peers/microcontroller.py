"""fusion-nav on the emulated boards of `examples/microcontroller`, next to a compiled design of 15 states.

Both programs read the same rows, and are built with the same settings. Their tool counts both.
"""

import shutil
import sys

import common

sys.path.insert(0, str(common.ROOT / "examples" / "microcontroller"))
import measure  # noqa: E402

VERSION = "0.1.0"
# The second board has no unit for numbers of 64 bits.
CASES = [("Cortex-M7", "z"), ("Cortex-M7", "2"), ("Cortex-M4F", "2")]
DESIGN = "15 states: strapdown, GNSS"
# What the program of fusion-nav expects of the rows.
STREAMS = 'STREAMS: [(&str, usize); 4] = [("imu", 6), ("position", 3), ("velocity", 3), ("reference", 10)]'
# In millimetres: further away than that from the last fix, the filter of fusion-nav has not worked.
FOLLOWS = 5000


def built():
    """The package of the program; its source is `microcontroller.rs`."""
    example, folder = common.ROOT / "examples" / "microcontroller", common.PEERS / "microcontroller"
    (folder / "src").mkdir(parents=True, exist_ok=True)
    shutil.copytree(example / ".cargo", folder / ".cargo", dirs_exist_ok=True)
    shutil.copy(example / "build.rs", folder / "build.rs")
    for module in ["board", "rows", "stack"]:
        shutil.copy(example / "src" / f"{module}.rs", folder / "src")
    source = common.Path(__file__).with_suffix(".rs").read_text()
    (folder / "src" / "main.rs").write_text(source)
    # The same settings and dependencies, with fusion-nav in place of the filter.
    manifest = (example / "Cargo.toml").read_text()
    manifest = "".join(part for part in manifest.splitlines(keepends=True) if not part.startswith(("filter", "fusion-abi", "exclude")))
    manifest = manifest.split("# The products of matrices")[0]
    manifest = manifest.replace("[dependencies]\n", f'[dependencies]\nfusion-nav = {{ version = "={VERSION}", default-features = false }}\n', 1)
    (folder / "Cargo.toml").write_text(manifest)
    return folder


def cells(facts, memory):
    """Instructions of a sample, a position and a velocity; flash, RAM, calls of panic."""
    rows = {stream: int(mean) for stream, _, mean, _ in (line.split() for line in facts["rows"])}
    numbers = [rows["imu"], rows["position"], rows["velocity"], int(facts["flash"][0]), memory]
    return [*(f"{number / 1000:.1f}" for number in numbers), facts["panics"][0]]


def compare(_options):
    for program in ["qemu-system-arm", "rustup"]:
        if shutil.which(program) is None:
            raise common.Missing(f"{program} is not installed")
    design, changes = measure.DESIGNS[DESIGN]
    expected = measure.compile_design(str(common.fusion()), common.ROOT / design, changes)
    if STREAMS not in (measure.FILTER / "src" / "lib.rs").read_text():
        raise common.Missing(f"{design} has other streams than the program of fusion-nav reads")
    folder, body = built(), []
    for board, level in CASES:
        profile = {"CARGO_PROFILE_RELEASE_OPT_LEVEL": level}
        ours = measure.measure(board, profile)
        measure.compare(DESIGN, board, ours, expected)
        stack = max(int(number) for number in ours["stack"][0].split())
        memory = int(ours["heap"][0].split()[1]) + int(ours["static"][0]) + stack
        body.append([board, f'`"{level}"`', "ours", *cells(ours, memory)])
        theirs = measure.measure(board, profile, folder)
        off = [abs(int(number)) for number in theirs["off"][0].split()]
        if max(off) > FOLLOWS:
            raise common.Missing(f"fusion-nav is {off} mm from the last fix")
        memory = sum(int(theirs[part][0]) for part in ["filter", "static", "stack"])
        body.append([board, f'`"{level}"`', "fusion-nav", *cells(theirs, memory)])
        common.say(f"{body[-2:]}, refused {theirs['refused'][0]}, off {off} mm")
    text = f"fusion-nav {VERSION} and `{design}` with 15 states each, on the same rows.\n\n"
    head = ["processor", "`opt-level`", "filter", "10³ instructions: sample", "position", "velocity", "flash [kB]", "RAM [kB]", "calls of panic"]
    return text + common.table(head, body)
