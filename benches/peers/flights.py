"""The simulated flights of fusion-nav: its simulator writes log and truth, its filter and ours read the log."""

import json
import shutil
from concurrent.futures import ThreadPoolExecutor

import common
import scores

VERSION = "0.1.0"
# The first of the seeds that judge. Our design was chosen on seeds 1001 to 1010. On 1 to 20 a fault of its magnetometer
# was found and mended, on 201 to 220 one of its start in the air, which is therefore judged on others.
FIRST = {"moving_start": 301}
SCENARIOS = """static mission harsh_imu bench hover_outage gnss_outage long_outage moving_start baro_drift gnss_latency
correlated mag_disturbance gnss_heading lever_arm no_mag multirotor_no_mag yaw_fault logging_dropout flight""".split()

# The part of our design for each instrument, by the name of its rows in the log.
INSTRUMENTS = {
    "gnss_pos": "gnss",
    "baro": "barometer",
    "mag": "magnetometer",
    "gnss_yaw": "gnss-heading",
    "stationary": "stationary",
}
# What else the first lines of a log say: the kind of vehicle, its start, and instruments that are worse.
VEHICLES = {"no_mag": "fixed-wing"}
STATED = {"moving_start": ["airborne"], "harsh_imu": ["harsh"], "correlated": ["slow"]}

# Our design's noises and gravity, as options of fusion-nav; its own noises are far larger.
TOLD = {"imu.gyro_white": 2.6e-4, "imu.accel_white": 2e-3, "imu.gyro_bias_walk": 1e-5, "imu.accel_bias_walk": 1e-4}
TOLD |= {"gravity": 9.80118, "correlation": "white"}
TOLD_HARSH = {"imu.gyro_white": 2.6e-3, "imu.accel_white": 2e-2, "imu.gyro_bias_walk": 2e-4, "imu.accel_bias_walk": 2e-3}
TOLD_SLOW = {"gnss_position": 23, "gnss_height": 106, "gnss_velocity": 0.43, "baro_altitude": 1.3, "mag_heading": 3.3}


def first_seed(scenario):
    """The first seed that judges a scenario."""
    return FIRST.get(scenario, 201)


def programs():
    """The simulator and the filter of fusion-nav."""
    source = common.crate("fusion-nav", VERSION)
    built = common.cargo_build(source, "--example", "simulate", "--example", "replay") / "examples"
    return built / "simulate", built / "replay"


def fly(simulate, scenario, seed):
    """A folder with a log and its truth."""
    folder = common.PEERS / "flights" / f"{scenario}-{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    common.run(simulate, scenario, folder, "--seed", seed)
    (folder / f"{scenario}.csv").rename(folder / "log.csv")
    (folder / f"{scenario}.truth.csv").rename(folder / "truth.csv")
    return folder


def told(scenario):
    """Options that give fusion-nav the noises of our design."""
    values = TOLD | (TOLD_HARSH if scenario == "harsh_imu" else {})
    if scenario == "correlated":
        del values["correlation"]
        values |= {f"correlation.{source}": seconds for source, seconds in TOLD_SLOW.items()}
    return [part for name, value in values.items() for part in ("--set", f"{name}={value}")]


def declared(folder, scenario, stated=True):
    """Our design for a log, in a file: a part for each instrument on board, and the facts of its first lines."""
    lines = (folder / "log.csv").read_text().splitlines()
    aboard = {line.split(",", 2)[1] for line in lines if line[:1].isdigit()}
    parts = ["vehicle", VEHICLES.get(scenario, "multirotor")]
    parts += [part for rows, part in INSTRUMENTS.items() if rows in aboard]
    parts += STATED.get(scenario, []) if stated else []
    text = "include = [" + ", ".join(f'"{common.DESIGNS / part}.toml"' for part in parts) + "]\n"
    arm = next((line.split()[3:6] for line in lines if line.startswith("# GNSS antenna")), [0, 0, 0])
    fixes = [line.split(",") for line in lines if ",gnss_pos," in line[:20]]
    if fixes:
        late = float(fixes[0][0]) - float(fixes[0][-1])
        for sensor, channel in (("gnss_position", "position"), ("gnss_velocity", "velocity")):
            text += f"sensor.{sensor}.lever_arm = [{', '.join(map(str, map(float, arm)))}]\n"
            text += f"source.{sensor}.channels.{channel}.latency = {late:.3f}\n"
    design = folder / "design.toml"
    design.write_text(text)
    return design


def estimated(program, folder, scenario, **options):
    """Our estimates of a log, as they were at each time, and the first line about the health."""
    out = folder / "out"
    design = declared(folder, scenario, **options)
    printed = common.run(program, "run", design, "--data", folder, "--causal", "--out", out)
    health = next(line.strip() for line in printed.splitlines() if line.strip().startswith("health"))
    return scores.rows(out / "estimates.csv", scores.OURS), health


def compare_one(tools, scenario, seed):
    """Sums of both programs over one flight, and of fusion-nav with the noises of our design."""
    simulate, replay, program = tools
    folder = fly(simulate, scenario, seed)
    truth = scores.rows(folder / "truth.csv", scores.TRUTH)
    common.run(replay, folder / "log.csv", folder / "shipped.csv")
    common.run(replay, folder / "log.csv", folder / "told.csv", *told(scenario))
    theirs, told_theirs = (scores.rows(folder / f"{name}.csv", scores.THEIRS) for name in ("shipped", "told"))
    ours, health = estimated(program, folder, scenario)
    steps = [step for step in sorted(theirs.keys() & truth.keys()) if step >= min(theirs) + scores.SETTLING]
    late = len([step for step in steps if step not in ours])
    steps = [step for step in steps if step in ours]
    result = {who: scores.sums(rows, truth, steps) for who, rows in (("ours", ours), ("theirs", theirs), ("told", told_theirs))}
    if scenario in STATED and scenario != "moving_start":
        plain, _ = estimated(program, folder, scenario, stated=False)
        result["plain"] = scores.sums(plain, truth, [step for step in steps if step in plain])
    shutil.rmtree(folder)
    return {**result, "late": late, "health": health}


def measured(options):
    """The scores of every scenario over all seeds."""
    tools = (*programs(), common.fusion())
    known = common.PEERS / "fusion-nav.json"
    results = json.loads(known.read_text()) if options.scenario and known.exists() else {}
    with ThreadPoolExecutor(common.CORES) as pool:
        for scenario in [options.scenario] if options.scenario else SCENARIOS:
            seeds = range(first_seed(scenario), first_seed(scenario) + options.seeds)
            flights = list(pool.map(lambda seed: compare_one(tools, scenario, seed), seeds))
            kinds = [who for who in ("ours", "theirs", "told", "plain") if who in flights[0]]
            totals = {who: [sum(part) for part in zip(*(f[who] for f in flights))] for who in kinds}
            results[scenario] = {who: scores.score(total) for who, total in totals.items()}
            results[scenario]["late"] = sum(f["late"] for f in flights)
            results[scenario]["lost"] = sum("lost" in f["health"] for f in flights)
            common.say(f"{scenario}: {json.dumps(results[scenario])}")
            known.write_text(json.dumps(results))
    return {scenario: results[scenario] for scenario in SCENARIOS if scenario in results}


def compare(options):
    results = measured(options)
    body, misses = [], []
    for scenario, found in results.items():
        ours, theirs, told_theirs = (found[who] for who in ("ours", "theirs", "told"))
        numbers = [f"{ours[m]:.3f} / {theirs[m]:.3f} / {told_theirs[m]:.3f}" for m in ("horizontal", "space")]
        numbers += [f"{ours['heading']:.2f} / {theirs['heading']:.2f}"]
        numbers += [f"{ours['anees']:.2f} / {theirs['anees']:.2f} / {told_theirs['anees']:.2f}"]
        body.append([f"`{scenario}`", *numbers])
        misses += [f"`{scenario}`: {text}" for text in missed(found)]
    text = f"fusion-nav {VERSION}, {options.seeds} seeds of each scenario. "
    text += "Each cell is ours / fusion-nav as shipped / fusion-nav with the noises of our design.\n\n"
    head = ["scenario", "horizontal RMS [m]", "RMS in space [m]", "heading RMS [deg], ours / as shipped"]
    text += common.table([*head, "ANEES of position"], body)
    outage = results["gnss_outage"]["ours"]["horizontal"] / results["gnss_outage"]["theirs"]["horizontal"]
    text += f"\nThe outage of 20 s: {outage:.2f} times the error of fusion-nav as shipped. "
    lost = [name for name, found in results.items() if found["lost"]]
    text += f"Flights in which our filter was *lost*: {', '.join(lost) or 'none'}.\n\n"
    text += "Bars that are not met: " + ("; ".join(misses) if misses else "none") + ".\n"
    for scenario in ("harsh_imu", "correlated"):
        plain, theirs = results[scenario]["plain"], results[scenario]["theirs"]
        text += f"\n`{scenario}` with the instruments of the other scenarios declared: {plain['horizontal']:.2f} m horizontally, "
        text += f"ANEES {plain['anees']:.1f}; fusion-nav as shipped {theirs['horizontal']:.2f} m.\n"
    return text


def missed(found):
    """The bars that a scenario does not meet, in words."""
    ours, theirs = found["ours"], found["theirs"]
    for measure, name in (("horizontal", "horizontal RMS"), ("space", "RMS in space")):
        if ours[measure] > theirs[measure]:
            yield f"{name} {ours[measure]:.3f} m, theirs {theirs[measure]:.3f} m"
    if not 0.7 <= ours["anees"] <= 1.4:
        yield f"ANEES {ours['anees']:.2f}, outside 0.7 to 1.4"
    if found["late"]:
        yield f"{found['late']} epochs at which our filter had not started"
