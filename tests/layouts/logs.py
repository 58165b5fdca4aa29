"""MCAP logs written by the `mcap` package and its ROS 2 and Protobuf writers."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.metadata import version
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import Message
from mcap.writer import CompressionType, Writer
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros2.writer import Writer as Ros2Writer

from book import START_UNIX_S, Book, mapped

MCAP = f"mcap {version('mcap')}"
ROS2 = f"mcap-ros2-support {version('mcap-ros2-support')}"
PROTOBUF = f"mcap-protobuf-support {version('mcap-protobuf-support')}, protobuf {version('protobuf')}"
STEP_NS = 1_000_000
# The sensor of the log with two clocks reports this long after the amplifier.
LAG_NS = 300_000
HEADER = """std_msgs/Header header
float64 voltage_v
float64 displacement_um
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def write(book: Book) -> None:
    """Write all MCAP layouts. The time of a message is its log time."""
    _json(book)
    _two_clocks(book)
    _ros2(book)
    _protobuf(book)


def _json(book: Book) -> None:
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    drive = [{"voltage_v": u} for u in warm["voltage_v"].tolist()]
    pairs = zip(warm["displacement_um"].tolist(), warm["temperature_degc"].tolist(), strict=True)
    sensor = [{"displacement_um": y, "temperature_degc": temperature} for y, temperature in pairs]
    messages = {"/amplifier": drive, "/sensor": sensor}
    _json_log(book, "mcap-json-two-topics.mcap", messages, CompressionType.LZ4)
    book.read("mcap-json-two-topics.mcap", MCAP, warm, time_from="start")

    plain = book.take()
    bare = {
        "/amplifier": [{"state": {"value": u}, "ok": True} for u in plain["voltage_v"].tolist()],
        "/sensor": [{"state": {"value": y}, "ok": True} for y in plain["displacement_um"].tolist()],
    }
    _json_log(book, "mcap-json-no-units.mcap", bare, CompressionType.ZSTD)
    book.ask("mcap-json-no-units.mcap", MCAP, ["/amplifier.state.value", "/sensor.state.value"])
    options = mapped(voltage_v="/amplifier.state.value", displacement_um="/sensor.state.value")
    book.read("mcap-json-no-units.mcap", MCAP, plain, options, time_from="start")


def _two_clocks(book: Book) -> None:
    """Two topics whose messages never have the same time: one of them has to be interpolated, not shifted."""
    plain = book.take()
    time = plain["time_s"]
    noise = plain["displacement_um"] - book.record["clean_um"]
    late = np.interp(time + 1e-9 * LAG_NS, time, book.record["clean_um"]) + 0.1 * noise
    messages = {
        "/amplifier": [{"voltage_v": u} for u in plain["voltage_v"].tolist()],
        "/sensor": [{"displacement_um": y} for y in late.tolist()],
    }
    _json_log(book, "mcap-json-two-clocks.mcap", messages, CompressionType.NONE, {"/sensor": LAG_NS})
    truth = plain | {"displacement_um": book.record["clean_um"]}
    # Nothing is extrapolated: the sensor has no value at the amplifier's first time.
    settings: dict[str, Any] = {"tolerance": 1e-3, "resampled": True, "time_tolerance_s": 1e-3, "time_from": "start"}
    settings |= {"left_out": 1, "free_rows": [0]}
    book.read("mcap-json-two-clocks.mcap", MCAP, truth, **settings)


def _json_log(
    book: Book,
    name: str,
    messages: dict[str, list[dict[str, object]]],
    compression: CompressionType,
    lag_ns: dict[str, int] | None = None,
) -> None:
    with book.path(name).open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=64 * 1024)
        writer.start(profile="", library="rig logger")
        channels = {}
        for topic, items in messages.items():
            schema = {"type": "object", "properties": {key: {} for key in items[0]}}
            schema_id = writer.register_schema(topic.strip("/"), "jsonschema", json.dumps(schema).encode())
            channels[topic] = writer.register_channel(topic, "json", schema_id)
        for row, moment in enumerate(_moments(len(next(iter(messages.values()))))):
            for topic, items in messages.items():
                at = moment + (lag_ns or {}).get(topic, 0)
                data = json.dumps(items[row]).encode()
                writer.add_message(channels[topic], log_time=at, publish_time=at, data=data, sequence=row)
        writer.finish()


def _ros2(book: Book) -> None:
    plain = book.take()
    rows = list(zip(plain["voltage_v"].tolist(), plain["displacement_um"].tolist(), strict=True))
    with book.path("mcap-ros2-float64.mcap").open("wb") as file:
        writer = Ros2Writer(file)
        schema = writer.register_msgdef("std_msgs/msg/Float64", "float64 data\n")
        for moment, row in zip(_moments(len(rows)), rows, strict=True):
            for topic, value in zip(("/amplifier/voltage", "/sensor/position"), row, strict=True):
                writer.write_message(topic, schema, {"data": value}, log_time=moment, publish_time=moment)
        writer.finish()
    book.ask("mcap-ros2-float64.mcap", ROS2, ["/amplifier/voltage.data", "/sensor/position.data"])
    options = mapped(voltage_v="/amplifier/voltage.data", displacement_um="/sensor/position.data")
    book.read("mcap-ros2-float64.mcap", ROS2, plain, options, time_from="start")

    with book.path("mcap-ros2-stamped.mcap").open("wb") as file:
        writer = Ros2Writer(file, compression=CompressionType.LZ4)
        schema = writer.register_msgdef("piezo_msgs/msg/Sample", HEADER)
        for moment, (voltage, displacement) in zip(_moments(len(rows)), rows, strict=True):
            stamp = {"sec": moment // 10**9, "nanosec": moment % 10**9}
            header = {"stamp": stamp, "frame_id": "stack"}
            message = {"header": header, "voltage_v": voltage, "displacement_um": displacement}
            writer.write_message("/piezo", schema, message, log_time=moment, publish_time=moment)
        writer.finish()
    book.read("mcap-ros2-stamped.mcap", ROS2, plain, time_from="start")


def _protobuf(book: Book) -> None:
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    sample = _message("Sample", {"count": 13, "voltage_v": 1, "displacement_um": 1, "temperature_degc": 1})
    bare = _message("Reading", {"drive": 1, "sensor": 1})
    with (
        book.path("mcap-protobuf.mcap").open("wb") as good,
        book.path("mcap-protobuf-no-units.mcap").open("wb") as other,
        ProtobufWriter(good) as log,
        ProtobufWriter(other) as other_log,
    ):
        for k, moment in enumerate(_moments(len(warm["time_s"]))):
            values = {name: float(one[k]) for name, one in warm.items() if name != "time_s"}
            log.write_message("/piezo", sample(count=k, **values), log_time=moment, publish_time=moment)
            reading = bare(drive=values["voltage_v"], sensor=values["displacement_um"])
            other_log.write_message("/rig", reading, log_time=moment, publish_time=moment)
    book.read("mcap-protobuf.mcap", PROTOBUF, warm, time_from="start")
    book.ask("mcap-protobuf-no-units.mcap", PROTOBUF, ["/rig.drive", "/rig.sensor"])
    options = mapped(voltage_v="/rig.drive", displacement_um="/rig.sensor")
    book.read("mcap-protobuf-no-units.mcap", PROTOBUF, book.take(), options, time_from="start")


def _message(name: str, fields: dict[str, int]) -> type[Message]:
    """Return a message class with these fields; the number is the Protobuf type (1 is double, 13 is uint32)."""
    file = descriptor_pb2.FileDescriptorProto(name=f"{name}.proto", package="piezo", syntax="proto3")
    message = file.message_type.add(name=name)
    for number, (field, kind) in enumerate(fields.items(), start=1):
        message.field.add(name=field, number=number, type=kind, label=1)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"piezo.{name}"))


def _moments(rows: int) -> Iterator[int]:
    return (START_UNIX_S * 10**9 + k * STEP_NS for k in range(rows))
