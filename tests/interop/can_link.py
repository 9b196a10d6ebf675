#!/usr/bin/env python3
"""The channels of CAN Link between motionctl and python-can, both ways, over socketcand and over slcan on
a pseudo-terminal: `can link list`, `watch`, `set`, and a controller (`run`) whose CAN 1 is on CAN Link.

usage: can_link.py PATH-OF-MOTIONCTL [socketcand] [slcan]
"""

import contextlib
import os
import sys
import tempfile
import threading
import time

import can

import common
from common import LIMIT, Device, Process, check, motionctl, pattern, slcan, socketcand, until

CHANNELS = range(1, 15)
start = time.monotonic()


def report(what):
    print(f"{what}: {common.passed} checks passed, {time.monotonic() - start:.1f} s", flush=True)


def value(channel, salt=0):
    """Bytes for a channel: all lengths from 0 to 8 occur, and no two are the same."""
    return bytes((byte + channel + salt) & 0xFF for byte in pattern(channel % 9))


def message(channel, data):
    return can.Message(arbitration_id=0x100 + channel, data=data, is_extended_id=False)


@contextlib.contextmanager
def opened(parameters):
    """python-can on the bus. It takes the greeting of a socketcand server for damaged if a frame follows
    within one read; then again."""
    def attempt():
        try:
            return can.Bus(**parameters)
        except can.CanError as error:
            print(f"connecting again: {error}", flush=True)
            return None
    bus = until("connected", attempt)
    try:
        yield bus
    finally:
        with contextlib.suppress(can.CanError, OSError):
            bus.shutdown()


@contextlib.contextmanager
def sending(bus, messages):
    """Sends these again and again, as a device at a period does: whoever comes later has them, too."""
    done = threading.Event()

    def run():
        # The adapter may have ended, and its line with it.
        with contextlib.suppress(can.CanError, OSError):
            while not done.wait(0.02):
                for each in messages:
                    bus.send(each)
    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join(LIMIT)


def receive(bus, wanted):
    """Reads until every channel has brought its bytes; nothing else may come on it."""
    missing = dict(wanted)
    end = time.monotonic() + LIMIT
    while missing and time.monotonic() < end:
        got = bus.recv(0.1)
        if got is None:
            continue
        channel = got.arbitration_id - 0x100
        check("an 11-bit data frame", (got.is_extended_id, got.is_remote_frame), (False, False))
        check("a channel that is sent on", channel in wanted)
        check(f"channel {channel}", bytes(got.data), wanted[channel])
        missing.pop(channel, None)
    check("channels that did not come", missing, {})


def tells(process, wanted, known=lambda line: "channel" in line and "data" in line):
    """Reads the stream until it has told of all these channels; no other bytes may be told."""
    missing = dict(wanted)
    while missing:
        line = process.line()
        if known(line):
            channel = line["channel"]
            check(f"channel {channel} is told", line["data"], wanted[channel].hex().upper())
            missing.pop(channel, None)


def commands(endpoint, parameters):
    """Every command, a process each, with python-can as the other device."""
    line = ["--can", endpoint]
    values = {channel: value(channel) for channel in CHANNELS}
    messages = [message(channel, data) for channel, data in values.items()]
    # motionctl reads what python-can sends.
    with Process("can", "link", "watch", "--for", str(LIMIT), *line) as watch, \
            opened(parameters()) as bus, sending(bus, messages):
        tells(watch, values)
    expected = {channel: data.hex().upper() for channel, data in values.items()}

    def listed():
        # Where motionctl is the adapter, python-can comes later, perhaps too late: then again.
        with Process("can", "link", "list", "--for", "2", *line) as listing, \
                opened(parameters()) as bus, sending(bus, messages):
            return {entry["channel"]: entry["data"] for entry in listing.line()["channels"]} == expected
    check("list", until("list", listed))
    # python-can reads what motionctl sends.
    for channel, data in values.items():
        with Device("can", "link", "set", str(channel), data.hex(), "--period", "0.02", *line) as device:
            check("ready", device.ready["channel"], channel)
            with opened(parameters()) as bus:
                receive(bus, {channel: data})
    # Both send on one channel: motionctl says so, with status 1.

    def conflicting():
        with Process("can", "link", "set", "3", "00", "--period", "0.02", "--for", "2", *line) as device:
            check("ready", device.line()["channel"], 3)
            with opened(parameters()) as bus, sending(bus, [message(3, b"\1")]):
                ended = device.line()
                return ended["conflict"] and device.process.wait(LIMIT) == 1
    check("conflict", until("conflict", conflicting))


def set_once(endpoint, parameters):
    """A value that is sent once, to one that listens before."""
    with opened(parameters()) as bus:
        for channel in CHANNELS:
            data = value(channel, salt=0x40)
            [told] = motionctl("can", "link", "set", str(channel), data.hex(), "--can", endpoint)
            check("set", (told["channel"], told["data"], told["conflict"]), (channel, data.hex().upper(), False))
            receive(bus, {channel: data})


def controller(endpoint, parameters):
    """A controller sends on channels 1 to 7 and hears python-can on the others."""
    own = {channel: value(channel, salt=0x80) for channel in range(1, 8)}
    others = {channel: value(channel, salt=0xC0) for channel in range(8, 15)}
    with tempfile.TemporaryDirectory() as directory:
        path = os.path.join(directory, "run.toml")
        with open(path, "w", encoding="utf-8") as file:
            file.write(f'[can1]\nendpoint = "{endpoint}"\n[parameters]\n302 = "Yes"\n')
            for channel, data in own.items():
                file.write(f'[[program]]\nat = 0\ndo = "send"\nbus = "can1"\nchannel = {channel}\n'
                           f'data = "{data.hex()}"\nperiod = 0.02\n')
        with Device("run", path, "--for", str(2 * LIMIT)) as run:
            check("role", run.ready["buses"], [{"bus": 1, "role": "can-link"}])
            with opened(parameters()) as bus:
                receive(bus, own)
                with sending(bus, [message(channel, data) for channel, data in others.items()]):
                    tells(run, others, lambda line: line["event"] == "channel")
                # A new value on a channel that had one.
                with sending(bus, [message(8, b"\x12\x34")]):
                    tells(run, {8: b"\x12\x34"}, lambda line: line["event"] == "channel")
                with sending(bus, [message(2, b"\1")]):
                    until("conflict", lambda: (line := run.line())["event"] == "conflict" and line["channel"] == 2)
                check("conflict", True)


def over_socketcand():
    with Device("bus", "--listen", "127.0.0.1:0") as bus:
        address = bus.ready["listen"]
        endpoint, parameters = f"socketcand:{address}/can0", lambda: socketcand(address)
        commands(endpoint, parameters)
        set_once(endpoint, parameters)
        report("socketcand, commands")
        controller(endpoint, parameters)
        report("socketcand, controller")


def over_slcan():
    with tempfile.TemporaryDirectory() as directory:
        link = os.path.join(directory, "can")

        def parameters():
            until("the adapter", lambda: os.path.exists(link))
            return slcan(link)
        commands(f"slcan-pty:{link}", parameters)
        report("slcan, commands")
        controller(f"slcan-pty:{link}", parameters)
        report("slcan, controller")


if __name__ == "__main__":
    for lane in sys.argv[2:] or ["socketcand", "slcan"]:
        {"socketcand": over_socketcand, "slcan": over_slcan}[lane]()
    print(f"{common.passed} passed, 0 failed")
