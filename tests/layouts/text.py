"""Text tables: what pandas and NumPy write, and the dialects of spreadsheets and data loggers."""

from __future__ import annotations

import codecs
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd

from book import CONVERTED, START_UNIX_S, Array, Book, Columns, mapped

PANDAS = f"pandas {pd.__version__}"
NUMPY = f"numpy {np.__version__} savetxt"
SPREADSHEET = "spreadsheet export"
LOGGER = "data logger"
START = datetime.fromtimestamp(START_UNIX_S, UTC)


def as_printed(values: Array, number_format: str) -> Array:
    """Return the values that a reader gets back from this number format."""
    return np.array([float(number_format % value) for value in values])


def lines(
    columns: Sequence[Array], number_format: str | Sequence[str], separator: str = ",", decimal: str = "."
) -> list[str]:
    """Return one line of text a row."""
    formats = [number_format] * len(columns) if isinstance(number_format, str) else number_format
    cells = [
        [(fmt % value).replace(".", decimal) for value in values] for fmt, values in zip(formats, columns, strict=True)
    ]
    return [separator.join(row) for row in zip(*cells, strict=True)]


def printed(book: Book, *names: str) -> Columns:
    """Return the columns with time to 6 decimals, voltage to 5, and the rest to 6."""
    formats = {"time_s": "%.6f", "voltage_v": "%.5f"}
    return {name: as_printed(values, formats.get(name, "%.6f")) for name, values in book.take(*names).items()}


def write(book: Book) -> None:
    """Write all text layouts but those of `instruments` and `trouble`."""
    _pandas(book)
    _pandas_clock(book)
    _savetxt(book)
    _headers(book)
    _dialects(book)
    _questions(book)
    _other_columns(book)


def save(book: Book, name: str, body: Sequence[str], end: str = "\n", encoding: str = "utf-8") -> None:
    """Write lines of text."""
    book.path(name).write_bytes((end.join(body) + end).encode(encoding))


def _pandas(book: Book) -> None:
    plain = book.take()
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    frame = pd.DataFrame(plain)
    frame.to_csv(book.path("csv-pandas-index.csv"))
    book.read("csv-pandas-index.csv", PANDAS, plain)
    pd.DataFrame(warm).to_csv(book.path("csv-pandas-european.csv"), sep=";", decimal=",", index=False)
    book.read("csv-pandas-european.csv", PANDAS, warm)
    gzip = {"method": "gzip", "mtime": 0}
    frame.to_csv(book.path("csv-pandas.csv.gz"), index=False, compression=gzip)
    book.read("csv-pandas.csv.gz", PANDAS, plain)
    frame.to_csv(book.path("csv-pandas.csv.zst"), index=False, compression="zstd")
    book.read("csv-pandas.csv.zst", PANDAS, plain)
    frame.to_csv(book.path("csv-pandas-format.tsv"), sep="\t", index=False, float_format="%.6g")
    book.read("csv-pandas-format.tsv", PANDAS, {name: as_printed(values, "%.6g") for name, values in plain.items()})


def _pandas_clock(book: Book) -> None:
    plain = book.take()
    frame = pd.DataFrame({name: plain[name] for name in ("voltage_v", "displacement_um")})
    frame.index = pd.date_range(START.replace(tzinfo=None), periods=len(frame), freq="ms", name="time")
    frame.to_csv(book.path("csv-pandas-datetime.csv"))
    book.read("csv-pandas-datetime.csv", PANDAS, plain, time_from="start")
    # ISO 8601 with a zone; Python leaves the fraction out at whole seconds.
    zone = pd.Index([(START + timedelta(milliseconds=k)).isoformat() for k in range(len(frame))], name="timestamp")
    frame.set_index(zone).to_csv(book.path("csv-pandas-iso8601.csv"), sep=";")
    book.read("csv-pandas-iso8601.csv", PANDAS, plain, time_from="start")


def _savetxt(book: Book) -> None:
    plain = book.take()
    matrix = np.column_stack(list(plain.values()))
    np.savetxt(book.path("txt-savetxt.txt"), matrix, header="time_s voltage_v displacement_um")
    book.read("txt-savetxt.txt", NUMPY, plain)
    formats = ["%10.4f", "%14.6f", "%14.6f"]
    header = "Stack 7, closed lid\n  Time[s]    Voltage[V]   Displacement[um]"
    np.savetxt(book.path("txt-aligned.dat"), matrix, fmt=formats, header=header, comments="% ")
    truth = {name: as_printed(values, fmt) for (name, values), fmt in zip(plain.items(), formats, strict=True)}
    book.read("txt-aligned.dat", NUMPY, truth)
    np.savetxt(book.path("txt-no-header.txt"), matrix, delimiter="\t")
    book.ask("txt-no-header.txt", NUMPY)
    by_number = mapped(time_s="1", voltage_v="2", displacement_um="3")
    book.read("txt-no-header.txt", NUMPY, plain, by_number)


def _headers(book: Book) -> None:
    """Names and units as people write them; values in other units are converted, and the reader says so."""
    time, voltage, displacement = book.take().values()
    nano, milli = as_printed(1e3 * displacement, "%.3f"), as_printed(1e3 * voltage, "%.1f")
    truth = printed(book)
    mixed = truth | {"displacement_um": nano / 1e3}

    body = lines([time, voltage, nano], ["%.6f", "%.5f", "%.3f"])
    save(book, "csv-units-brackets.csv", ["Time (s),Voltage (V),Displacement [nm]", *body])
    book.read("csv-units-brackets.csv", LOGGER, mixed, tolerance=CONVERTED, says=["nm"])

    body = lines([1e3 * time, milli, nano], ["%.0f", "%.1f", "%.3f"], ";")
    save(book, "csv-units-suffix.csv", ["t_ms;U_mV;disp_nm", *body])
    both = mixed | {"voltage_v": milli / 1e3}
    book.read("csv-units-suffix.csv", LOGGER, both, tolerance=CONVERTED, says=["mV", "nm", "ms"])

    body = lines([time, milli, displacement], ["%.6f", "%.1f", "%.6f"])
    save(book, "csv-millivolt.csv", ["time_s,voltage_mV,displacement_um", *body])
    book.read("csv-millivolt.csv", LOGGER, truth | {"voltage_v": milli / 1e3}, tolerance=CONVERTED, says=["mV"])

    plain_lines = lines([time, voltage, displacement], ["%.6f", "%.5f", "%.6f"])
    quoted = '"Time, elapsed (s)","Voltage, drive (V)","Displacement, sensor 1 (µm)"'
    save(book, "csv-quoted-commas.csv", [quoted, *plain_lines])
    book.read("csv-quoted-commas.csv", LOGGER, truth)

    slashes = ["Time / s\tVoltage / V\tPosition / µm", *lines([time, voltage, displacement], "%.6f", "\t")]
    save(book, "txt-units-slash.txt", slashes)
    six = {name: as_printed(values, "%.6f") for name, values in book.take().items()}
    book.read("txt-units-slash.txt", LOGGER, six)

    save(book, "csv-units-row.csv", ["time,voltage,displacement", "s,V,um", *plain_lines])
    book.read("csv-units-row.csv", LOGGER, truth)


def _dialects(book: Book) -> None:
    time, voltage, displacement = book.take().values()
    truth = printed(book)
    warm = printed(book, "time_s", "voltage_v", "displacement_um", "temperature_degc")
    formats = ["%.6f", "%.5f", "%.6f"]
    head = "time_s,voltage_v,displacement_um"
    body = lines([time, voltage, displacement], formats)
    comma = lines(list(warm.values()), [*formats, "%.6f"], ";", ",")

    unicode_head = "Zeit [s];Spannung [V];Weg [\u03bcm];Temperatur [°C]"
    text = "\r\n".join([unicode_head, *comma, ""])
    book.path("csv-utf16-comma.csv").write_bytes(codecs.BOM_UTF16_LE + text.encode("utf-16-le"))
    book.read("csv-utf16-comma.csv", SPREADSHEET, warm)

    latin = ["Zeit (s);Spannung (V);Auslenkung (µm);Temperatur (°C)", *comma]
    save(book, "csv-latin1.csv", latin, "\r\n", "latin-1")
    book.read("csv-latin1.csv", SPREADSHEET, warm)

    separator_line = ["sep=;", head.replace(",", ";"), *lines([time, voltage, displacement], formats, ";", ",")]
    save(book, "csv-excel-sep-line.csv", separator_line, "\r\n", "utf-8-sig")
    book.read("csv-excel-sep-line.csv", SPREADSHEET, truth)

    notes = ["# stack 7, closed lid", "# amplifier: 20 V/V, range 0,150 V", head]
    save(book, "csv-comments.csv", [*notes, *body[:1500], "# lid opened", *body[1500:]])
    book.read("csv-comments.csv", LOGGER, truth)

    save(book, "csv-trailing-comma.csv", [head + ",", *(line + "," for line in body)])
    book.read("csv-trailing-comma.csv", LOGGER, truth)

    save(book, "csv-carriage-return.csv", [head, *body], "\r")
    book.read("csv-carriage-return.csv", SPREADSHEET, truth)

    save(book, "csv-crlf-blank-end.csv", [head, *body, "", ""], "\r\n")
    book.read("csv-crlf-blank-end.csv", SPREADSHEET, truth)

    spaced = [" time_s, voltage_v, displacement_um", *(line.replace(",", ", ") for line in body)]
    save(book, "csv-space-after-comma.csv", spaced)
    book.read("csv-space-after-comma.csv", LOGGER, truth)

    quoted = [",".join(f'"{cell}"' for cell in line.split(",")) for line in [head, *body]]
    save(book, "csv-all-quoted.csv", quoted)
    book.read("csv-all-quoted.csv", SPREADSHEET, truth)


def _questions(book: Book) -> None:
    """Files that do not say a role or a unit: the reader asks, and the answer is a `--map` line."""
    time, voltage, displacement = book.take().values()
    truth = printed(book)
    formats = ["%.6f", "%.5f", "%.6f"]
    body = lines([time, voltage, displacement], formats)

    save(book, "csv-no-units.csv", ["t,V,x", *body])
    book.ask("csv-no-units.csv", LOGGER, [r"\bx\b"])
    book.read("csv-no-units.csv", LOGGER, truth, mapped(time_s="t", voltage_v="V", displacement_um="x"))

    save(book, "csv-no-header.csv", body)
    book.ask("csv-no-header.csv", LOGGER)
    by_number = mapped(time_s="1", voltage_v="2", displacement_um="3")
    book.read("csv-no-header.csv", LOGGER, truth, by_number)

    save(
        book,
        "csv-odd-names.csv",
        ["Clock time;Drive signal;Bob's sensor $1", *lines(list(truth.values()), formats, ";")],
    )
    book.ask("csv-odd-names.csv", LOGGER, ["Drive signal", "Bob"])
    options = mapped(time_s="Clock time", voltage_v="Drive signal", displacement_um="Bob's sensor $1")
    book.read("csv-odd-names.csv", LOGGER, truth, options)

    twice = lines([time, voltage, displacement, 0.5 * displacement], [*formats, "%.6f"])
    save(book, "csv-two-outputs.csv", ["time_s,voltage_v,sensor_a_um,sensor_b_um", *twice])
    book.ask("csv-two-outputs.csv", LOGGER, ["sensor_a_um", "sensor_b_um"])
    book.read("csv-two-outputs.csv", LOGGER, truth, mapped(displacement_um="sensor_a_um"))

    save(book, "csv-no-time.csv", ["voltage_v,displacement_um", *lines([voltage, displacement], formats[1:])])
    book.ask("csv-no-time.csv", LOGGER, ["--rate"], paste=False)
    book.read("csv-no-time.csv", LOGGER, truth, ["--rate", "1000"])


def _other_columns(book: Book) -> None:
    time, voltage, displacement, load = book.take("time_s", "voltage_v", "displacement_um", "load_n").values()
    truth = printed(book)
    formats = ["%.6f", "%.5f", "%.6f", "%.6f"]

    falling = truth | {"displacement_um": -truth["displacement_um"]}
    save(book, "csv-falling.csv", [",".join(truth), *lines(list(falling.values()), formats[:3])])
    book.read("csv-falling.csv", LOGGER, falling)
    book.read("csv-falling.csv", LOGGER, truth, mapped(displacement_um="-displacement_um"))

    save(
        book,
        "csv-load.csv",
        ["time_s,voltage_v,displacement_um,load_n", *lines([time, voltage, displacement, load], formats)],
    )
    book.read("csv-load.csv", LOGGER, printed(book, "time_s", "voltage_v", "displacement_um", "load_n"))

    force = as_printed(3.0 * displacement, "%.6f")
    save(book, "csv-force.csv", ["Time [s],Voltage [V],Force [N]", *lines([time, voltage, force], formats[:3])])
    columns = {"time_s": truth["time_s"], "voltage_v": truth["voltage_v"], "force_n": force}
    book.read("csv-force.csv", LOGGER, columns)

    segment = np.repeat([0.0, 1.0, 2.0], 1000)
    apart = truth | {"time_s": as_printed(time + 2.5 * segment, "%.6f")}
    body = lines([segment, *apart.values()], ["%.0f", *formats[:3]])
    save(book, "csv-segments.csv", ["segment,time_s,voltage_v,displacement_um", *body])
    book.read("csv-segments.csv", "record CSV", apart, segments=3)
