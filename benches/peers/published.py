"""Figures that others have published: the filter of a textbook on one draw of its sensors, and the tables of UKF-M."""

import csv
import gzip
import json
import math

import common

# Attitude [deg], position [m], NEES of both over their dimension, as published (`ukfm`, Brossard, Barrau, Bonnabel 2019).
UKFM = {
    ("localisation-2d", "error_state"): ("12.00", "0.76", "4.91", "275"),
    ("localisation-2d", "invariant"): ("11.35", "0.45", "1.00", "2.02"),
    ("inertial-landmarks", "error_state"): ("3.20", "0.82", "11.4", "276"),
    ("inertial-landmarks", "invariant"): ("2.83", "0.24", "1.14", "1.37"),
}
RUNS = 100


def rows(path, names=None):
    """Rows of a table, as numbers by the name of the column."""
    with gzip.open(path, "rt") if path.suffix == ".gz" else open(path) as file:
        return [{name: float(value) for name, value in row.items() if value} for row in csv.DictReader(file, names)]


def rms(errors):
    return math.sqrt(sum(error * error for error in errors) / len(errors))


def textbook(program):
    """Ours and the textbook's filter against the truth, and against each other."""
    folder = common.data_set("groves_profile1") / "derived"
    out = common.PEERS / "groves"
    common.run(program, "run", common.DESIGNS / "groves.toml", "--data", common.DATA, "--out", out)
    truth = rows(folder / "ref.csv.gz")
    names = list(truth[0])
    by_time = {"textbook": rows(folder / "textbook_filter.csv.gz", names), "truth": truth}
    by_time = {who: {round(100 * row["t"]): row for row in table} for who, table in by_time.items()}
    by_time["ours"] = {}
    for row in rows(out / "estimates.csv"):
        places = {"lat": row["lat_deg"], "lon": row["lon_deg"], "h": row["height_m"], "yaw": row["yaw_deg"]}
        by_time["ours"][round(100 * row["t_s"])] = places
    times = sorted(set(by_time["ours"]) & set(by_time["textbook"]) & set(by_time["truth"]))
    degree = math.radians(6_378_137.0)
    metres = {"lat": degree, "lon": degree * math.cos(math.radians(51)), "h": 1.0, "yaw": 1.0}

    def apart(a, b):
        errors = {name: [by_time[a][t][name] - by_time[b][t][name] for t in times] for name in metres}
        errors["yaw"] = [(e + 180) % 360 - 180 for e in errors["yaw"]]
        return [f"{scale * rms(errors[name]):.3f}" for name, scale in metres.items()]

    pairs = [("ours", "truth"), ("textbook", "truth"), ("ours", "textbook")]
    head = ["RMS of the difference", "north [m]", "east [m]", "height [m]", "heading [deg]"]
    return common.table(head, [[f"{a} and {b}", *apart(a, b)] for a, b in pairs])


def pooled(result):
    """Attitude, position and NEES of both, of the first table of a comparison."""
    table = result["sections"][0]["tables"][0]
    found = {column["name"]: cell for column, cell in zip(table["columns"], table["rows"][0]["cells"])}
    wanted = ["attitude RMSE", "position RMSE", "NEES/n attitude", "NEES/n position"]
    return [f"{found[name]:.3g}" for name in wanted]


def compare(_options):
    program = common.fusion()
    text = "The car of Groves' textbook, loosely coupled, one draw of its sensors (`groves_profile1`):\n\n"
    text += textbook(program)
    text += f"\nThe benchmarks of UKF-M, {RUNS} runs each; the cells are ours / published:\n\n"
    body = []
    for (name, backend), published in UKFM.items():
        design = common.ROOT / "configs" / "published" / f"{name}.toml"
        printed = common.run(program, "compare", design, "--backend", backend, "-n", RUNS, "--format", "json")
        ours = pooled(json.loads(printed))
        body.append([f"`{name}`, `{backend}`", *(f"{a} / {b}" for a, b in zip(ours, published))])
    head = ["benchmark and backend", "attitude [deg]", "position [m]", "NEES of attitude", "NEES of position"]
    return text + common.table(head, body)
