"""EKF2 of PX4, by the crate `ekf2`, on the simulated flights of fusion-nav.

Its C++ sources need a C++ compiler, and bindgen needs libclang, which the package `libclang` of PyPI has.
"""

import os
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import common
import flights
import scores

VERSION = "0.1.0"
SEEDS = 3
# It has no GNSS, so EKF2 gives no position.
LEFT_OUT = ["bench"]


def built():
    """The program that runs EKF2 over a log; its source is `autopilot.rs`."""
    common.python_packages("libclang==18.1.1")
    folder = common.PEERS / "autopilot"
    (folder / "src").mkdir(parents=True, exist_ok=True)
    shutil.copy(Path(__file__).with_suffix(".rs"), folder / "src" / "main.rs")
    (folder / "Cargo.toml").write_text(
        '[package]\nname = "autopilot"\nversion = "0.0.0"\nedition = "2024"\n'
        f'[dependencies]\nekf2 = "={VERSION}"\n[workspace]\n'
    )
    library = next(Path(sys.prefix).glob("lib/python3*/site-packages/clang/native"))
    # libclang of PyPI comes without the headers of a compiler.
    headers = common.run("g++", "-print-file-name=include").strip()
    os.environ.update(LIBCLANG_PATH=str(library), BINDGEN_EXTRA_CLANG_ARGS=f"-I{headers}")
    return common.cargo_build(folder) / "autopilot"


def compare_one(tools, scenario, seed):
    """Sums of both over the time in which EKF2 says that its position is valid."""
    simulate, ekf2, program = tools
    folder = flights.fly(simulate, scenario, seed)
    truth = scores.rows(folder / "truth.csv", scores.TRUTH)
    latency = 150 if scenario == "gnss_latency" else 0
    common.run(ekf2, folder / "log.csv", folder / "ekf2.csv", latency, flights.VEHICLES.get(scenario, "multirotor"))
    theirs = scores.rows(folder / "ekf2.csv", scores.THEIRS)
    ours, _ = flights.estimated(program, folder, scenario)
    steps = sorted(theirs.keys() & truth.keys() & ours.keys())
    result = [scores.sums(rows, truth, steps) for rows in (ours, theirs)]
    shutil.rmtree(folder)
    return result


def compare(_options):
    tools = (flights.programs()[0], built(), common.fusion())
    body = []
    with ThreadPoolExecutor(common.CORES) as pool:
        for scenario in flights.SCENARIOS:
            if scenario in LEFT_OUT:
                continue
            first = flights.first_seed(scenario)
            runs = list(pool.map(lambda seed: compare_one(tools, scenario, seed), range(first, first + SEEDS)))
            ours, theirs = ([sum(part) for part in zip(*(run[k] for run in runs))] for k in (0, 1))
            if ours[0] == 0:
                body.append([f"`{scenario}`", "EKF2 reports no valid position", "", "", ""])
                continue
            ours, theirs = scores.score(ours), scores.score(theirs)
            digits = {"horizontal": 3, "height": 2, "heading": 2, "anees_horizontal": 2}
            cells = [f"{ours[m]:.{n}f} / {theirs[m]:.{n}f}" for m, n in digits.items()]
            body.append([f"`{scenario}`", *cells])
            common.say(" ".join(body[-1]))
    text = f"ekf2 {VERSION}, {SEEDS} seeds of each scenario, over the time in which EKF2 calls its position valid. "
    text += "Each cell is ours / EKF2.\n\n"
    head = ["scenario", "horizontal RMS [m]", "height RMS [m]", "heading RMS [deg]", "ANEES, horizontal"]
    return text + common.table(head, body)
