"""The frames of pymavlink 2.4.50 that tests.rs is held against.

    python3 by_pymavlink.py

Every message that the output sends has the values of `plain()` of tests.rs: level and to the north, so that the angles
and the velocity in body axes are exact. A line is the frame of a message.
"""

import math

from pymavlink.dialects.v20 import ardupilotmega as dialect

LAT, LON, HEIGHT = 0.8, -0.25, 431.5
VELOCITY = [4.0, -3.0, 1.25]
WEEK, SECONDS = 2374, 259_200.25
UNIX = 315_964_800 + WEEK * 604_800 + SECONDS - 18
UNKNOWN = math.nan


def covariance(rows, columns):
    """The block of `exact()` of tests.rs: position, velocity and attitude are 0, 1 and 2."""
    of = lambda i, j: (64 if i == j else 0) + min(i, j) + max(i, j) / 16
    return [[of(3 * rows + i, 3 * columns + j) for j in range(3)] for i in range(3)]


def pose():
    """The upper triangle of north, east, down, roll, pitch, yaw."""
    halves = [[covariance(a, b) for b in (0, 2)] for a in (0, 2)]
    whole = [sum((block[i] for block in row), []) for row in halves for i in range(3)]
    return [whole[i][j] for i in range(6) for j in range(i, 6)]


def body_velocity():
    """The upper triangle of the velocity in body axes, with unknown angular rates.

    v_b = Cᵀ (v_n + δv), and C changes with the attitude error: δv_b = δv + v × δθ.
    """
    v = VELOCITY
    cross = [[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]]
    times = lambda a, b: [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    turned = lambda a: [list(row) for row in zip(*a)]
    of_v, both, of_angle = covariance(1, 1), covariance(1, 2), covariance(2, 2)
    across = times(both, turned(cross))
    parts = [of_v, across, turned(across), times(times(cross, of_angle), turned(cross))]
    known = [[sum(part[i][j] for part in parts) for j in range(3)] for i in range(3)]
    return [known[i][j] if j < 3 else UNKNOWN for i in range(6) for j in range(i, 6)]


def main():
    sender = dialect.MAVLink(None, srcSystem=42, srcComponent=197)
    degrees = [round(math.degrees(angle) * 1e7) for angle in (LAT, LON)]
    usec, sigma = round(UNIX * 1e6), lambda block, axes: math.sqrt(max(block[k][k] for k in axes))
    place, velocity = covariance(0, 0), covariance(1, 1)
    # The pitch is minus the arcsine of zero.
    angles = [0, -0.0, 0]
    messages = [
        dialect.MAVLink_odometry_message(
            usec, dialect.MAV_FRAME_LOCAL_NED, dialect.MAV_FRAME_BODY_FRD, 0, 0, 0, [1, 0, 0, 0], *VELOCITY,
            UNKNOWN, UNKNOWN, UNKNOWN, pose(), body_velocity(), 0, 0, 100,
        ),
        dialect.MAVLink_vision_position_estimate_message(usec, 0, 0, 0, *angles, pose(), 0),
        dialect.MAVLink_gps_input_message(
            usec, 0, 2 | 4, round(SECONDS * 1000), WEEK, 3, *degrees, HEIGHT, 65535, 65535, *VELOCITY,
            sigma(velocity, range(3)), sigma(place, range(2)), sigma(place, [2]), 255, 36000,
        ),
        dialect.MAVLink_global_position_int_message(
            12_500, *degrees, 431_500, 0, *(round(100 * v) for v in VELOCITY), 0
        ),
    ]
    for message in messages:
        print(message.pack(sender).hex())
        sender.seq += 1


main()
