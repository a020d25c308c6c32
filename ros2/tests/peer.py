"""A node of another implementation of DDS, Cyclone DDS: it publishes or receives messages with the types of ROS 2.

peer.py publish DOMAIN PREFIX IMUS FIXES     publishes IMUS messages with 200 Hz, FIXES with 5 Hz, each on two topics
peer.py receive DOMAIN PREFIX COUNT          prints COUNT messages of odometry and of fixes, as lines of JSON

It prints `matched` when it has found the other side. A publisher then waits for a line.
"""

import json
import sys
import threading
import time
from dataclasses import asdict, dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int8, int32, uint8, uint16, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class NavSatStatus(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatStatus_"):
    status: int8
    service: uint16


@dataclass
class NavSatFix(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatFix_"):
    header: Header
    status: NavSatStatus
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


RELIABLE = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepAll)
BEST_EFFORT = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(5))


def header(k):
    return Header(Time(1_700_000_000 + k, k), f"frame {k % 7}")


def imu(k):
    """Its fields have numbers that follow each other, in the order of the message."""
    n = [1000.0 * k + 0.5 * j for j in range(37)]
    return Imu(header(k), Quaternion(*n[:4]), n[4:13], Vector3(*n[13:16]), n[16:25], Vector3(*n[25:28]), n[28:37])


def fix(k):
    n = [1000.0 * k + 0.5 * j for j in range(12)]
    return NavSatFix(header(k), NavSatStatus(k % 3 - 1, 60000 + k), n[0], n[1], n[2], n[3:12], k % 4)


def wait_for(what):
    while not what():
        time.sleep(0.02)


def publish(domain, prefix, imus, fixes):
    participant = DomainParticipant(domain)

    def writers(name, kind):
        topics = [(f"rt{prefix}/{name}/reliable", RELIABLE), (f"rt{prefix}/{name}/best_effort", BEST_EFFORT)]
        return [DataWriter(participant, Topic(participant, topic, kind), qos=qos) for topic, qos in topics]

    def send(writers, make, count, rate):
        begin = time.monotonic()
        for k in range(count):
            time.sleep(max(0.0, begin + k / rate - time.monotonic()))
            for writer in writers:
                writer.write(make(k))

    of_imu, of_fix = writers("imu", Imu), writers("fix", NavSatFix)
    wait_for(lambda: all(writer.get_matched_subscriptions() for writer in of_imu + of_fix))
    print("matched", flush=True)
    sys.stdin.readline()
    threads = [
        threading.Thread(target=send, args=(of_imu, imu, imus, 200.0)),
        threading.Thread(target=send, args=(of_fix, fix, fixes, 5.0)),
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    # Stays until the other side has everything.
    sys.stdin.readline()


def receive(domain, prefix, count):
    participant = DomainParticipant(domain)
    kinds = [("odometry", Odometry), ("fix", NavSatFix)]
    topics = [(name, Topic(participant, f"rt{prefix}/{name}", kind)) for name, kind in kinds]
    readers = [(name, DataReader(participant, topic, qos=RELIABLE)) for name, topic in topics]
    wait_for(lambda: all(reader.get_matched_publications() for _, reader in readers))
    print("matched", flush=True)
    for name, reader in readers:
        got = 0
        while got < count:
            for message in reader.take(N=count - got):
                print(json.dumps({"topic": name, "message": asdict(message)}), flush=True)
                got += 1
            time.sleep(0.005)


if __name__ == "__main__":
    command, domain, prefix, *counts = sys.argv[1:]
    {"publish": publish, "receive": receive}[command](int(domain), prefix, *map(int, counts))
