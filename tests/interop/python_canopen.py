#!/usr/bin/env python3
"""motionctl against python-canopen and python-can, both ways, over socketcand and over slcan on a
pseudo-terminal: scan, SDO in every mode that the peer has, PDO mapping, NMT, SYNC, EMCY, heartbeat,
guarding, LSS.

usage: python_canopen.py PATH-OF-MOTIONCTL [socketcand] [slcan] [LOG]

LOG, a file that ends with .log: what went over the socketcand bus.
"""

import os
import sys
import tempfile
import time

import common
from common import Device, check, motionctl, slcan, socketcand
from motionctl_master import motionctl_is_master, motionctl_is_master_and_adapter
from python_master import python_is_lss_master, python_is_master

# As few bits as can be: python-canopen waits for each that is set.
SERIAL = 64
start = time.monotonic()


def report(what):
    print(f"{what}: {common.passed} checks passed, {time.monotonic() - start:.1f} s", flush=True)


def over_socketcand(log):
    with Device("bus", "--listen", "127.0.0.1:0", "--bitrate", "1000000") as bus:
        address = bus.ready["listen"]
        endpoint, python = f"socketcand:{address}/can0", socketcand(address)
        with Device("can", "record", log, "--can", endpoint):
            with Device("sim", "io", "--node", "5", "--wired", "--can", endpoint):
                # python-can's socketcand driver has no remote frames.
                python_is_master(python, 5, remote_frames=False)
                guarding(endpoint)
            report("socketcand, python-canopen master")
            with Device("sim", "io", "--node", "255", "--serial-number", str(SERIAL), "--can", endpoint):
                python_is_lss_master(python, SERIAL)
            report("socketcand, LSS")
            motionctl_is_master(endpoint, python)
            report("socketcand, motionctl master")


def guarding(endpoint):
    """Of our node by our master, so that the log has it."""
    [*_, shown] = motionctl("can", "guard", "5", "--period", "0.05", "--for", "1", "--can", endpoint)
    check("guarding", (shown["event"], shown["state"]), ("state", "pre-operational"))


def over_slcan():
    with tempfile.TemporaryDirectory() as directory:
        link = os.path.join(directory, "can")
        with Device("sim", "io", "--node", "5", "--wired", "--can", f"slcan-pty:{link}"):
            python_is_master(slcan(link), 5, remote_frames=True)
        report("slcan, python-canopen master")
        with Device("sim", "io", "--node", "255", "--serial-number", str(SERIAL), "--can", f"slcan-pty:{link}"):
            python_is_lss_master(slcan(link), SERIAL)
        report("slcan, LSS")
        motionctl_is_master_and_adapter(link)
        report("slcan, motionctl master")


def main(arguments):
    lanes = [argument for argument in arguments if not argument.endswith(".log")] or ["socketcand", "slcan"]
    with tempfile.TemporaryDirectory() as directory:
        logs = [argument for argument in arguments if argument.endswith(".log")]
        log = logs[0] if logs else os.path.join(directory, "bus.log")
        if "socketcand" in lanes:
            over_socketcand(log)
        if "slcan" in lanes:
            over_slcan()
    print(f"{common.passed} passed, 0 failed")


if __name__ == "__main__":
    main(sys.argv[2:])
