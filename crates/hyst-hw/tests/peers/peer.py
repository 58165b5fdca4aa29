"""The other end of an slcan line, with python-can and can-isotp.

peer.py frames PORT           prints each received frame and returns it with reversed data and the last bit of the identifier inverted
peer.py isotp PORT FD BLOCK   prints the length of each received message and returns the message reversed
"""

import sys
import time

import can
import isotp

# Upper limit; the test that started this program ends it earlier.
SECONDS = 300.0


def frames(bus):
    while message := bus.recv(SECONDS):
        kind = ("T" if message.is_extended_id else "t") + ("f" if message.is_fd else "c")
        print(f"{message.arbitration_id:x} {kind} {message.data.hex()}", flush=True)
        answer = can.Message(
            arbitration_id=message.arbitration_id ^ 1,
            is_extended_id=message.is_extended_id,
            is_fd=message.is_fd,
            # Frames with and without bit-rate switching have different letters.
            bitrate_switch=message.is_fd and message.arbitration_id % 4 < 2,
            data=message.data[::-1],
            check=True,
        )
        bus.send(answer)


def messages(bus, fd, block):
    address = isotp.Address(isotp.AddressingMode.Normal_11bits, rxid=0x6A0, txid=0x6A1)
    parameters = {
        "blocksize": block,
        "stmin": 0,
        "tx_data_length": 64 if fd else 8,
        "can_fd": fd,
        "tx_padding": 0xAA,
        "max_frame_size": 4095,
    }
    errors = []
    stack = isotp.CanStack(bus, address=address, params=parameters, error_handler=errors.append)
    stack.start()
    until = time.monotonic() + SECONDS
    while time.monotonic() < until:
        message = stack.recv(block=True, timeout=0.5)
        for error in errors:
            print(f"error {error}", flush=True)
        errors.clear()
        if message is not None:
            print(len(message), flush=True)
            stack.send(message[::-1])
    stack.stop()


if __name__ == "__main__":
    what, port, *rest = sys.argv[1:]
    with can.Bus(interface="slcan", channel=port, bitrate=500000, sleep_after_open=0) as line:
        print("ready", flush=True)
        if what == "frames":
            frames(line)
        else:
            messages(line, rest[0] == "fd", int(rest[1]))
