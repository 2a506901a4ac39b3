"""What a receiver tells of a ping, a room for each kind: how the truth draws it, how a belief scores it, what is seen of it."""

from tagtrack.envs.sensors.presence import MeasuredReception, PresenceReceiver
from tagtrack.envs.sensors.ranging import RangeReceiver
from tagtrack.envs.sensors.sensor import Sensor
from tagtrack.envs.sensors.stereo import StereoHydrophone, Weighting
from tagtrack.envs.sensors.time_of_flight import Measurements, TimeOfFlightReceiver

SENSORS: dict[str, type[Sensor]] = {
    sensor.name: sensor
    for sensor in (StereoHydrophone, TimeOfFlightReceiver, RangeReceiver, PresenceReceiver, MeasuredReception)
}

__all__ = [
    "SENSORS",
    "MeasuredReception",
    "Measurements",
    "PresenceReceiver",
    "RangeReceiver",
    "Sensor",
    "StereoHydrophone",
    "TimeOfFlightReceiver",
    "Weighting",
]
