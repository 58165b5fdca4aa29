"""Text exports of instruments, written from their published descriptions."""

from __future__ import annotations

import numpy as np

from book import CONVERTED, RATE_HZ, Book, mapped
from text import as_printed, lines, printed, save

TRIGGER_S = 0.5


def write(book: Book) -> None:
    """Write all instrument exports."""
    _tektronix(book)
    _volts_only(book)
    _picoscope(book)
    _physik_instrumente(book)
    _interferometers(book)


def _tektronix(book: Book) -> None:
    """Tektronix MSO: settings, then the names. Channel 2 has a custom vertical unit. Time 0 is the trigger."""
    time, voltage, displacement = book.take().values()
    settings = [
        "Model,MSO44",
        "Firmware Version,1.28.3",
        "",
        "Waveform Type,ANALOG,",
        "Point Format,Y,",
        "Horizontal Units,s,",
        "Horizontal Scale,0.4,",
        "Horizontal Delay,0,",
        f"Sample Interval,{1 / RATE_HZ:g},",
        f"Record Length,{len(time)},",
        "Gating,0.0% to 100.0%,",
        "Probe Attenuation,20,1",
        "Vertical Units,V,um",
        "Vertical Offset,0,0",
        "Vertical Scale,20,2",
        "Vertical Position,0,0",
        ",,",
        ",,",
        ",,",
        "Label,Amplifier,Sensor",
        "TIME,CH1,CH2",
    ]
    formats = ["%.6e", "%.5f", "%.6f"]
    shifted = as_printed(time - TRIGGER_S, formats[0])
    save(book, "scope-tektronix.csv", [*settings, *lines([shifted, voltage, displacement], formats)])
    book.read("scope-tektronix.csv", "Tektronix MSO4 CSV export", printed(book) | {"time_s": shifted})


def _volts_only(book: Book) -> None:
    """Oscilloscopes that know only volts: which channel is the output, and its scale, is not in the file."""
    time, voltage, displacement = book.take().values()
    body = lines([time - TRIGGER_S, voltage, 0.5 * displacement], "%+.6E")
    save(book, "scope-keysight.csv", ["x-axis,1,2", "second,Volt,Volt", *body], "\r\n")
    book.ask("scope-keysight.csv", "Keysight InfiniiVision CSV export", [r"\b(V|Volts?)\b"], paste=False)

    index = np.arange(len(time), dtype=np.float64)
    body = lines([index, voltage, 0.5 * displacement], ["%.0f", "%.6e", "%.6e"])
    start = f"Sequence,Volt,Volt,{-TRIGGER_S:.6e},{1 / RATE_HZ:.6e}"
    save(book, "scope-rigol.csv", ["X,CH1,CH2,Start,Increment,", start, *(line + "," for line in body)])
    book.ask("scope-rigol.csv", "Rigol DS1000Z CSV export", ["CH1", "CH2"], paste=False)


def _picoscope(book: Book) -> None:
    """PicoScope: names, units in brackets, an empty line. Channel B has a custom probe that measures nm."""
    time, voltage, displacement = book.take().values()
    milli = as_printed(1e3 * (time - TRIGGER_S), "%.8f")
    volt = as_printed(voltage, "%.8f")
    nano = as_printed(1e3 * displacement, "%.8f")
    head = ["Time,Channel A,Channel B", "(ms),(V),(nm)", ""]
    save(book, "scope-picoscope.csv", [*head, *lines([milli, volt, nano], "%.8f")], "\r\n")
    truth = {"time_s": milli / 1e3, "voltage_v": volt, "displacement_um": nano / 1e3}
    writer = "PicoScope 7 CSV export"
    book.read("scope-picoscope.csv", writer, truth, tolerance=CONVERTED, says=["nm"])

    head = ["Zeit;Kanal A;Kanal B", "(ms);(V);(nm)", ""]
    save(book, "scope-picoscope-german.csv", [*head, *lines([milli, volt, nano], "%.8f", ";", ",")], "\r\n")
    book.read("scope-picoscope-german.csv", writer, truth, tolerance=CONVERTED, says=["nm"])


def _physik_instrumente(book: Book) -> None:
    """PI GCS array from a data recorder: period and names in the header, no time column, no units."""
    voltage, displacement = book.take("voltage_v", "displacement_um").values()
    names = ("Control Voltage of Piezo channel 1", "Actual Position of axis A")
    head = [
        "# REM E-727",
        "#",
        "# VERSION = 1",
        "# TYPE = 1",
        "# SEPARATOR = 32",
        "# DIM = 2",
        f"# SAMPLE_TIME = {1 / RATE_HZ:.6f}",
        f"# NDATA = {len(voltage)}",
        "#",
        *(f"# NAME{k} = {name}" for k, name in enumerate(names)),
        "#",
        "# END_HEADER",
    ]
    body = lines([voltage, displacement], "%.6f", " ")
    save(book, "txt-pi-recorder.dat", [line + " " for line in [*head, *body]])
    writer = "PI GCS 2.0 data recorder"
    book.ask("txt-pi-recorder.dat", writer, list(names))
    truth = printed(book) | {"voltage_v": as_printed(voltage, "%.6f")}
    book.read("txt-pi-recorder.dat", writer, truth, mapped(voltage_v=names[0], displacement_um=names[1]))


def _interferometers(book: Book) -> None:
    """Vibrometer export with a row of units in metres; interferometer log in µs, mV and pm."""
    time, voltage, displacement = book.take().values()
    metres = as_printed(1e-6 * displacement, "%.9E")
    head = [
        "Source File Name:\tstack7.pvd",
        "Signal:\tTime Avg",
        "Point Index:\t1",
        "",
        "Time\tVoltage Ref1\tDisplacement Vib",
        "[ s ]\t[ V ]\t[ m ]",
    ]
    body = lines([time, voltage, metres], ["%.6f", "%.6f", "%.9E"], "\t")
    save(book, "txt-vibrometer.txt", [*head, *body], "\r\n")
    truth = {"time_s": time, "voltage_v": as_printed(voltage, "%.6f"), "displacement_um": 1e6 * metres}
    book.read("txt-vibrometer.txt", "Polytec-like ASCII export", truth, tolerance=CONVERTED)

    pico = np.round(1e6 * displacement)
    milli = as_printed(1e3 * voltage, "%.1f")
    head = ["# displacement sensor IDS", "# averaging: 1", "Time (µs)\tU (mV)\tPosition axis 1 (pm)"]
    body = lines([1e6 * time, milli, pico], ["%.0f", "%.1f", "%.0f"], "\t")
    save(book, "txt-interferometer.txt", [*head, *body])
    truth = {"time_s": time, "voltage_v": milli / 1e3, "displacement_um": pico / 1e6}
    writer = "attocube-like text log"
    book.read("txt-interferometer.txt", writer, truth, tolerance=CONVERTED, says=["pm", "mV"])
