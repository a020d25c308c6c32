"""Errors of estimates against the truth of a simulated flight, the same for every program.

All are taken at multiples of 0.1 s, from one second after the start of the program that is compared with.
"""

import math

STEP = 0.1  # s
SETTLING = 10  # steps
TRUTH = {"place": ["pos_n", "pos_e", "pos_d"], "yaw": "yaw"}
OURS = {"place": ["n_m", "e_m", "d_m"], "sigma": ["sigma_n_m", "sigma_e_m", "sigma_d_m"], "yaw_deg": "yaw_deg"}
THEIRS = {
    "place": ["pos_n", "pos_e", "pos_d"],
    "sigma": ["sigma_pos_n", "sigma_pos_e", "sigma_pos_d"],
    "quaternion": ["q0", "q1", "q2", "q3"],
}


def rows(path, columns):
    """Rows of a table at multiples of `STEP`: number of the step -> (place, 1σ, heading)."""
    found, at = {}, None
    with open(path) as lines:
        for line in lines:
            if line.startswith("#"):
                continue
            if at is None:
                names = line.strip().split(",")
                at = {key: [names.index(n) for n in ([c] if isinstance(c, str) else c)] for key, c in columns.items()}
                continue
            steps = float(line[: line.index(",")]) / STEP
            if abs(steps - round(steps)) > 1e-4:
                continue
            cells = line.rstrip("\n").split(",")
            found[round(steps)] = row({key: [float(cells[i]) for i in places] for key, places in at.items()})
    return found


def row(values):
    """Place, 1σ and heading of a row."""
    if "quaternion" in values:
        w, x, y, z = values["quaternion"]
        heading = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    else:
        heading = values["yaw"][0] if "yaw" in values else math.radians(values["yaw_deg"][0])
    return values["place"], values.get("sigma"), heading


def sums(estimate, truth, steps):
    """Sums over the steps, to be added over the seeds: squares of errors, and of errors over their 1σ."""
    horizontal = vertical = heading = normalised = level = 0.0
    for step in steps:
        (place, sigma, yaw), (true_place, _, true_yaw) = estimate[step], truth[step]
        north, east, down = (a - b for a, b in zip(place, true_place))
        horizontal += north**2 + east**2
        vertical += down**2
        heading += ((yaw - true_yaw + math.pi) % math.tau - math.pi) ** 2
        squares = [(e / s) ** 2 for e, s in zip((north, east, down), sigma)]
        normalised += sum(squares) / 3
        level += sum(squares[:2]) / 2
    return [len(steps), horizontal, vertical, heading, normalised, level]


def score(total):
    """RMS horizontal, in space and of the height [m], of the heading [deg], and ANEES, of sums over all seeds."""
    count, horizontal, vertical, heading, normalised, level = total
    return {
        "horizontal": math.sqrt(horizontal / count),
        "space": math.sqrt((horizontal + vertical) / count),
        "heading": math.degrees(math.sqrt(heading / count)),
        "height": math.sqrt(vertical / count),
        "anees": normalised / count,
        "anees_horizontal": level / count,
    }
