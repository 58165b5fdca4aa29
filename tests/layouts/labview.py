"""LabVIEW files: TDMS written by npTDMS, LVM written from the published description of the format."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from importlib.metadata import version

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from nptdms.types import Uint32

from book import CONVERTED, RATE_HZ, START_UNIX_S, Array, Book, Columns, mapped
from text import as_printed, lines

NPTDMS = f"npTDMS {version('npTDMS')}"
LVM = "LVM 2.0 from its description by National Instruments"
START = np.datetime64(datetime.datetime.fromtimestamp(START_UNIX_S, datetime.UTC).replace(tzinfo=None), "us")
UNITS = {"Voltage": "V", "Displacement": "µm", "Temperature": "°C"}
ROOT = RootObject({"title": "stack 7", "operator": "A. Person"})


def write(book: Book) -> None:
    """Write all TDMS and LVM layouts."""
    _waveforms(book)
    _time_channels(book)
    _two_rates(book)
    _linear_scale(book)
    _lvm(book)


def _waveform(period_s: float) -> dict[str, object]:
    return {"wf_start_time": START, "wf_start_offset": 0.0, "wf_increment": period_s}


def _channels(group: str, columns: Mapping[str, Array], properties: Mapping[str, object]) -> list[ChannelObject]:
    return [
        ChannelObject(group, name, values, {"unit_string": UNITS[name], **properties})
        for name, values in zip(UNITS, columns.values(), strict=False)
    ]


def _waveforms(book: Book) -> None:
    warm = book.take("voltage_v", "displacement_um", "temperature_degc")
    truth = book.take("time_s") | warm
    with TdmsWriter(book.path("tdms-waveform.tdms")) as file:
        file.write_segment([ROOT, GroupObject("Log"), *_channels("Log", warm, _waveform(1e-3))])
    book.read("tdms-waveform.tdms", NPTDMS, truth, time_from="start")

    plain = book.take("voltage_v", "displacement_um")
    with TdmsWriter(book.path("tdms-ten-segments.tdms")) as file:
        for rows in np.array_split(np.arange(len(truth["time_s"])), 10):
            part = {name: values[rows] for name, values in plain.items()}
            file.write_segment([ROOT, *_channels("Log", part, _waveform(1e-3))])
    book.read("tdms-ten-segments.tdms", NPTDMS, book.take(), time_from="start")

    single = {name: values.astype(np.float32) for name, values in plain.items()}
    with TdmsWriter(book.path("tdms-float32.tdms")) as file:
        file.write_segment([ROOT, *_channels("Log", single, _waveform(1e-3))])
    truth = book.take("time_s") | {name: values.astype(np.float64) for name, values in single.items()}
    book.read("tdms-float32.tdms", NPTDMS, truth, time_from="start")

    with TdmsWriter(book.path("tdms-no-units.tdms")) as file:
        bare = zip(("Dev1/ai0", "Dev1/ai1"), plain.values(), strict=True)
        file.write_segment([ROOT, *(ChannelObject("Log", name, one, _waveform(1e-3)) for name, one in bare)])
    book.ask("tdms-no-units.tdms", NPTDMS, ["Log/Dev1/ai0", "Log/Dev1/ai1"])
    options = mapped(voltage_v="Log/Dev1/ai0", displacement_um="Log/Dev1/ai1")
    book.read("tdms-no-units.tdms", NPTDMS, book.take(), options, time_from="start")


def _time_channels(book: Book) -> None:
    plain = book.take("voltage_v", "displacement_um")
    time = book.record["time_s"]
    with TdmsWriter(book.path("tdms-time-channel.tdms")) as file:
        clock = ChannelObject("Log", "Time", time, {"unit_string": "s"})
        file.write_segment([ROOT, clock, *_channels("Log", plain, {})])
    book.read("tdms-time-channel.tdms", NPTDMS, book.take())

    with TdmsWriter(book.path("tdms-timestamps.tdms")) as file:
        moments = START + np.arange(len(time)) * np.timedelta64(1000, "us")
        file.write_segment([ROOT, ChannelObject("Log", "Timestamp", moments), *_channels("Log", plain, {})])
    book.read("tdms-timestamps.tdms", NPTDMS, book.take(), time_from="start")


def _two_rates(book: Book) -> None:
    """Voltage and displacement at 1 kHz; temperature in another group at 10 Hz, to be interpolated or held."""
    plain = book.take("voltage_v", "displacement_um")
    slow = 22.0 + 0.8 * (1 - np.exp(-np.arange(31) / 10 / 1.5))
    with TdmsWriter(book.path("tdms-two-rates.tdms")) as file:
        thermometer = ChannelObject("Slow", "Temperature", slow, {"unit_string": "°C", **_waveform(0.1)})
        file.write_segment([ROOT, *_channels("Fast", plain, _waveform(1e-3)), thermometer])
    truth = book.take() | book.take("temperature_degc")
    book.read("tdms-two-rates.tdms", NPTDMS, truth, time_from="start", loose={"temperature_degc": 0.08})


def _linear_scale(book: Book) -> None:
    """Codes of a converter with NI's linear scale in the properties; npTDMS and LabVIEW return the scaled values."""
    columns = book.take("time_s")
    channels = []
    for name, column, slope, offset in (
        ("Voltage", "voltage_v", 0.004, 50.0),
        ("Displacement", "displacement_um", 0.0005, 6.0),
    ):
        codes = np.round((book.record[column] - offset) / slope).astype(np.int16)
        scale = {
            "NI_Scaling_Status": "unscaled",
            "NI_Number_Of_Scales": Uint32(1),
            "NI_Scale[0]_Scale_Type": "Linear",
            "NI_Scale[0]_Linear_Slope": slope,
            "NI_Scale[0]_Linear_Y_Intercept": offset,
            "NI_Scale[0]_Linear_Input_Source": Uint32(0xFFFFFFFF),
        }
        properties = {"unit_string": UNITS[name], **_waveform(1e-3), **scale}
        channels.append(ChannelObject("Log", name, codes, properties))
        columns[column] = codes * slope + offset
    with TdmsWriter(book.path("tdms-linear-scale.tdms")) as file:
        file.write_segment([ROOT, *channels])
    book.read("tdms-linear-scale.tdms", NPTDMS, columns, tolerance=CONVERTED, time_from="start")


def _lvm(book: Book) -> None:
    """LVM writes six decimals."""
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    truth = {name: as_printed(values, "%.6f") for name, values in warm.items()}
    signals = list(warm.values())[1:]
    zero = "0.000000"

    body = lines([warm["time_s"], *signals], "%.6f", "\t")
    text = _lvm_header("One") + _lvm_segment(len(warm["time_s"]), 1, "X_Value\tVoltage\tDisplacement\tTemperature")
    _save(book, "lvm-one-x-column.lvm", [text, *(line + "\t" for line in body)], truth)

    pairs = [column for signal in signals for column in (warm["time_s"], signal)]
    names = "\t".join(f"X_Value\t{name}" for name in UNITS)
    text = _lvm_header("Multi") + _lvm_segment(len(warm["time_s"]), 2, names)
    _save(book, "lvm-x-per-channel.lvm", [text, *(line + "\t" for line in lines(pairs, "%.6f", "\t"))], truth)

    text = _lvm_header("No") + _lvm_segment(len(warm["time_s"]), 1, "X_Value\tVoltage\tDisplacement\tTemperature")
    body = ["\t" + line + "\t" for line in lines(signals, "%.6f", "\t")]
    _save(book, "lvm-no-x-column.lvm", [text, *body], truth)

    text = _lvm_header("One") + _lvm_segment(len(warm["time_s"]), 1, "X_Value\tVoltage\tDisplacement\tTemperature")
    text = text.replace("Decimal_Separator\t.", "Decimal_Separator\t,").replace("0.001000", "0,001000")
    text = text.replace(zero, "0,000000")
    body = [line + "\t" for line in lines([warm["time_s"], *signals], "%.6f", "\t", decimal=",")]
    _save(book, "lvm-decimal-comma.lvm", [text, *body], truth)


def _lvm_header(x_columns: str) -> str:
    """Return the file header."""
    tags = {
        "LabVIEW Measurement": "",
        "Writer_Version": "2",
        "Reader_Version": "2",
        "Separator": "Tab",
        "Decimal_Separator": ".",
        "Multi_Headings": "No",
        "X_Columns": x_columns,
        "Time_Pref": "Relative",
        "Operator": "lab",
        "Date": "2024/05/13",
        "Time": "10:21:14.0000000000000",
    }
    return "".join(f"{tag}\t{value}\r\n" for tag, value in tags.items()) + "***End_of_Header***\t\r\n\t\r\n"


def _lvm_segment(rows: int, step: int, names: str) -> str:
    """Return the segment header; with an x column per channel (`step` 2) each value is followed by an empty cell."""
    gap = "\t" * step
    tags = {
        "Samples": [str(rows)] * 3,
        "Date": ["2024/05/13"] * 3,
        "Time": ["10:21:14.0000000000000"] * 3,
        "Y_Unit_Label": ["Volts", "um", "degC"],
        "X_Dimension": ["Time"] * 3,
        "X0": ["0.000000"] * 3,
        "Delta_X": [f"{1 / RATE_HZ:.6f}"] * 3,
    }
    head = "".join(f"{tag}\t{gap.join(values)}\t\r\n" for tag, values in tags.items())
    return f"Channels\t3\t\t\t\r\n{head}***End_of_Header***\t\t\t\t\r\n{names}\tComment\r\n"


def _save(book: Book, name: str, parts: list[str], truth: Columns) -> None:
    head, *body = parts
    book.path(name).write_bytes((head + "".join(line + "\r\n" for line in body)).encode("ascii"))
    book.read(name, LVM, truth)
