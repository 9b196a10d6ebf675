#!/usr/bin/env python3
"""Records an interop run of each role for the fixtures in ../recorded, with transfers of up to 890 bytes.

usage: record.py PATH-OF-MOTIONCTL DIRECTORY
"""

import importlib.metadata
import os
import platform
import subprocess
import sys
import tempfile

import common
from common import MOTIONCTL, Device, socketcand
from motionctl_master import motionctl_is_master
from python_canopen import guarding
from python_master import python_is_master


def python_master(endpoint, python):
    with Device("sim", "io", "--node", "5", "--wired", "--can", endpoint):
        python_is_master(python, 5, remote_frames=False)
        guarding(endpoint)


RUNS = {
    "python-canopen-master": (
        python_master, "motionctl sim io --node 5 --wired; master: python-canopen, guarding by motionctl"),
    "motionctl-master": (
        motionctl_is_master, "python-canopen LocalNode 20, interop/common.py's dictionary; master: motionctl"),
}


def main(directory):
    common.SIZES[:] = [size for size in common.SIZES if size <= 890]
    version = subprocess.run([MOTIONCTL, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    peers = [f"{name} {importlib.metadata.version(name)}" for name in ("canopen", "python-can")]
    for name, (run, device) in RUNS.items():
        with tempfile.TemporaryDirectory() as scratch:
            log = os.path.join(scratch, "bus.log")
            with Device("bus", "--listen", "127.0.0.1:0", "--bitrate", "1000000") as bus:
                endpoint = f"socketcand:{bus.ready['listen']}/can0"
                with Device("can", "record", log, "--can", endpoint):
                    run(endpoint, socketcand(bus.ready["listen"]))
            with open(log) as frames, open(os.path.join(directory, f"{name}.log"), "w") as out:
                out.write(f"# device: {device}\n")
                out.write(f"# stacks: {version}; {', '.join(peers)}; Python {platform.python_version()}\n")
                out.write("# taken by: interop/record.py, `motionctl can record` on a virtual bus of 1 Mbit/s\n")
                out.write(frames.read())


main(sys.argv[2])
