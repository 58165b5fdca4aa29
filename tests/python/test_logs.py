"""Logs of runs, read by other programs: the `mcap` package and the command line `pymcap-cli`.

`cargo xtask test` makes the logs and sets HYST_LOGS to their folder.
"""

import csv
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = os.environ.get("HYST_LOGS")
if not FOLDER:
    pytest.skip(
        "HYST_LOGS is not the path of a folder with logs; `cargo run -p hyst-tests --example every_log -- FOLDER` makes them",
        allow_module_level=True,
    )

from jsonschema import Draft202012Validator  # noqa: E402
from mcap.reader import NonSeekingReader, SeekingReader  # noqa: E402

FOLDER = Path(FOLDER)
LOGS = json.loads((FOLDER / "logs.json").read_text())
# Topic of the events.
EVENTS = "/actuator/event"
# Names of the columns of a record in a log.
FIELDS = {"voltage_v": "drive_v", "displacement_um": "output", "reference_um": "reference"}
KINDS = ("drive", "plain", "gain", "feedforward", "pid", "pid+feedforward", "line", "on-device", "failed", "interrupted")


def test_there_are_logs_of_every_kind():
    names = [log["log"].removesuffix(".mcap") for log in LOGS]
    assert set(KINDS) <= set(names)
    assert {"again", "again.~1~"} <= set(names), "an earlier log was renamed"
    assert sum(name.startswith("recovered-") for name in names) == 40


def rows(log):
    """Returns the samples that hystctl reads from the log."""
    with open(FOLDER / log["samples"], newline="") as file:
        return [{FIELDS.get(name, name): float(cell) for name, cell in row.items()} for row in csv.DictReader(file)]


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log["log"])
def test_a_log_is_read(log):
    with open(FOLDER / log["log"], "rb") as file:
        reader = SeekingReader(file, validate_crcs=True)
        messages = list(reader.iter_messages())
        # As a stream, without the indexes at its end.
        file.seek(0)
        stream = list(NonSeekingReader(file, validate_crcs=True).iter_messages())
        assert [m.data for _, _, m in stream] == [m.data for _, _, m in messages]

        summary = reader.get_summary()
        assert summary.statistics.message_count == len(messages)
        assert {c.topic for c in summary.channels.values()} - {EVENTS} == {"/actuator/sample"}
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
        others = {f"{name}.{key}": text for name in metadata if name != "run" for key, text in metadata[name].items()}
        assert metadata["run"] | others == log["metadata"]
        assert {"program", "version", "device", "output_column", "unit", "sample_rate_hz"} <= set(log["metadata"])
        attached = [(a.name, a.media_type, a.data) for a in reader.iter_attachments()]
        model = ("model.json", "application/json", (FOLDER / "model.json").read_bytes())
        assert attached == ([model] if log["model"] else [])

    times = [m.log_time for _, _, m in messages]
    assert all(a <= b for a, b in zip(times, times[1:]))
    events = [json.loads(m.data) for _, c, m in messages if c.topic == EVENTS]
    assert [event["kind"] for event in events] == {"failed": ["fault"], "interrupted": ["cancelled"]}.get(log["log"].removesuffix(".mcap"), [])
    messages = [message for message in messages if message[1].topic != EVENTS]
    wanted = rows(log)
    assert len(messages) == len(wanted)
    for number, ((schema, channel, message), row) in enumerate(zip(messages, wanted)):
        assert schema.encoding == "jsonschema" and channel.message_encoding == "json"
        assert message.sequence == number
        sample = json.loads(message.data)
        assert message.log_time == pytest.approx(1e9 * sample["time_s"], abs=1)
        assert {name: sample[name] for name in row} == row
    times = [m.log_time for _, _, m in messages]
    assert all(a < b for a, b in zip(times, times[1:]))


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log["log"])
def test_samples_follow_the_schema(log):
    with open(FOLDER / log["log"], "rb") as file:
        reader = SeekingReader(file)
        summary = reader.get_summary()
        known = {}
        for channel in summary.channels.values():
            schema = json.loads(summary.schemas[channel.schema_id].data)
            Draft202012Validator.check_schema(schema)
            numbers = {name for name, field in schema["properties"].items() if "number" in field["type"]}
            assert {name.removeprefix("unit.") for name in channel.metadata} == numbers, "every number has its unit"
            known[channel.topic] = (Draft202012Validator(schema), set(schema["properties"]))
        for _, channel, message in reader.iter_messages():
            validator, fields = known[channel.topic]
            content = json.loads(message.data)
            validator.validate(content)
            assert set(content) <= fields
            sample = content if channel.topic != EVENTS else sample
    if log["log"].startswith("drive"):
        assert {"temperature_degc", "load_n"} <= set(sample)


def pymcap(*arguments):
    """Runs the command line of this environment. Returns its exit code and the JSON of its lines."""
    program = Path(sys.executable).with_name("pymcap-cli")
    ran = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    return ran.returncode, [json.loads(line) for line in ran.stdout.splitlines()]


@pytest.mark.parametrize("log", LOGS, ids=lambda log: log["log"])
def test_the_doctor_finds_no_fault(log):
    path = FOLDER / log["log"]
    code, [*findings, summary] = pymcap("doctor", "--strict-message-order", "--format", "jsonl", path)
    # Findings of severity "info" are remarks (no attachment, small chunks), not faults.
    assert (code, [finding for finding in findings if finding["severity"] != "info"]) == (0, [])
    code, [info] = pymcap("info-json", path)
    assert code == 0
    with open(path, "rb") as file:
        wanted = SeekingReader(file).get_summary().statistics
    assert summary["messages"] == info["statistics"]["message_count"] == wanted.message_count
    counts = {channel["id"]: channel["message_count"] for channel in info["channels"]}
    assert counts == wanted.channel_message_counts


def test_the_doctor_finds_a_truncated_log(tmp_path):
    whole = (FOLDER / LOGS[0]["log"]).read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    code, lines = pymcap("doctor", "--format", "jsonl", tmp_path / "cut.mcap")
    assert code == 1
    assert "MISSING_FOOTER" in {line.get("code") for line in lines if line.get("severity") == "error"}


def test_the_schema_rejects_invalid_samples():
    with open(FOLDER / LOGS[0]["log"], "rb") as file:
        schemas = SeekingReader(file).get_summary().schemas.values()
        schema = next(json.loads(schema.data) for schema in schemas if schema.name == "hyst.actuator.Sample")
    validator = Draft202012Validator(schema)
    sample = {"time_s": 0.1, "segment": 0, "phase": "record", "drive_v": 1.0, "output": 2.0}
    assert validator.is_valid(sample)
    for wrong in ({"phase": "rest"}, {"time_s": "0.1"}, {"segment": 0.5}, {"output": "2.0"}):
        assert not validator.is_valid(sample | wrong), wrong
    assert not validator.is_valid({name: sample[name] for name in list(sample)[:-1]})
