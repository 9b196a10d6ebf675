"""What both roles share: checks, processes of motionctl, buses of python-can, the objects of the nodes.

Nothing here waits for a time: every wait is for something that is to happen, with a limit.
"""

import json
import logging
import os
import queue
import signal
import subprocess
import sys
import threading
import time

import can
import canopen
from canopen.objectdictionary import (
    INTEGER16, UNSIGNED8, UNSIGNED16, UNSIGNED32, ODRecord, ODVariable, ObjectDictionary, datatypes)

# It warns of every read that ends within a message, which the next one completes.
logging.getLogger("can.interfaces.socketcand.socketcand").setLevel(logging.ERROR)

# The receiving thread of python-can ends with its adapter, which is a process of ours; what was to come
# is waited for elsewhere.
unexpected = threading.excepthook
threading.excepthook = lambda end: None if issubclass(end.exc_type, can.CanError) else unexpected(end)

MOTIONCTL = os.path.abspath(sys.argv[1])
SIZES = [1, 2, 3, 4, 5, 7, 8, 100, 889, 890, 10_000, 100_000]
# The longest that anything may take on a machine that does much else.
LIMIT = 30
passed = 0


def check(what, found, expected=True):
    global passed
    if found != expected:
        shown = [text if len(text) < 300 else f"{text[:300]}… ({len(text)} characters)"
                 for text in (repr(found), repr(expected))]
        raise AssertionError(f"{what}: {shown[0]}, expected {shown[1]}")
    passed += 1


def pattern(size):
    return bytes((i * 7 + size) & 0xFF for i in range(size))


def until(what, condition):
    """Waits for a condition, which it returns."""
    end = time.monotonic() + LIMIT
    while not (found := condition()):
        if time.monotonic() > end:
            raise AssertionError(f"{what}: not within {LIMIT} s")
        time.sleep(0.002)
    return found


class Inbox:
    """What comes on one identifier from now on."""

    def __init__(self, network, identifier):
        self.messages = queue.Queue()
        self.network, self.identifier = network, identifier
        self.take = lambda _, data, __: self.messages.put(bytes(data))
        network.subscribe(identifier, self.take)

    def get(self):
        return self.messages.get(timeout=LIMIT)

    def wait_for(self, *wanted):
        """Reads on until one of these comes; returns it."""
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            if (data := self.get()) in wanted:
                return data
        raise AssertionError(f"{self.identifier:X}: none of {wanted} within {LIMIT} s")

    def close(self):
        self.network.unsubscribe(self.identifier, self.take)


class Process:
    """motionctl, running until it is left."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([MOTIONCTL, "--json", *arguments], stdout=subprocess.PIPE, text=True)

    def line(self):
        line = self.process.stdout.readline()
        if not line:
            raise AssertionError(f"{self.process.args} has ended with status {self.process.wait(LIMIT)}")
        return json.loads(line)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGTERM)
        self.process.communicate(timeout=LIMIT)


class Device(Process):
    """One that says when it is ready."""

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.ready = self.line()


def motionctl(*arguments, status=0):
    done = subprocess.run([MOTIONCTL, "--json", *arguments], capture_output=True, text=True, timeout=4 * LIMIT)
    if done.returncode != status:
        raise AssertionError(
            f"{arguments}: status {done.returncode}, expected {status}: {done.stdout}{done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()]


def variable(parent, name, index, sub, data_type, pdo=False, default=0, access="rw"):
    entry = ODVariable(name, index, sub)
    entry.data_type = data_type
    entry.access_type = access
    entry.pdo_mappable = pdo
    entry.default = default
    if isinstance(parent, ObjectDictionary):
        parent.add_object(entry)
    else:
        parent.add_member(entry)
    return entry


def dictionary():
    """The objects of the virtual I/O node that these tests use, as a master knows them."""
    od = ObjectDictionary()
    variable(od, "Device type", 0x1000, 0, UNSIGNED32, default=0x00012345, access="ro")
    variable(od, "Error register", 0x1001, 0, UNSIGNED8)
    variable(od, "Device name", 0x1008, 0, datatypes.VISIBLE_STRING, default="python node", access="ro")
    variable(od, "Heartbeat time", 0x1017, 0, UNSIGNED16)
    identity = ODRecord("Identity", 0x1018)
    od.add_object(identity)
    variable(identity, "Count", 0x1018, 0, UNSIGNED8, default=4)
    for sub, name in enumerate(["Vendor", "Product", "Revision", "Serial"], 1):
        variable(identity, name, 0x1018, sub, UNSIGNED32, default=sub * 0x11)
    store = ODRecord("Store", 0x2000)
    od.add_object(store)
    variable(store, "Count", 0x2000, 0, UNSIGNED8, default=1)
    variable(store, "Data", 0x2000, 1, datatypes.DOMAIN)
    for communication, mapping, identifier in [(0x1400, 0x1600, 0x200), (0x1800, 0x1A00, 0x180)]:
        record = ODRecord(f"Communication {communication:X}", communication)
        od.add_object(record)
        variable(record, "Count", communication, 0, UNSIGNED8, default=6)
        variable(record, "COB-ID", communication, 1, UNSIGNED32, default=identifier)
        variable(record, "Type", communication, 2, UNSIGNED8)
        variable(record, "Inhibit", communication, 3, UNSIGNED16)
        variable(record, "Event", communication, 5, UNSIGNED16)
        record = ODRecord(f"Mapping {mapping:X}", mapping)
        od.add_object(record)
        variable(record, "Count", mapping, 0, UNSIGNED8)
        for sub in range(1, 9):
            variable(record, f"Entry {sub}", mapping, sub, UNSIGNED32)
    for index, name, data_type in [(0x6000, "Inputs", UNSIGNED8), (0x6200, "Outputs", UNSIGNED8),
                                   (0x6401, "Analogue in", INTEGER16), (0x6411, "Analogue out", INTEGER16)]:
        record = ODRecord(name, index)
        od.add_object(record)
        variable(record, "Count", index, 0, UNSIGNED8)
        for sub in range(1, 5 if index > 0x6400 else 2):
            variable(record, f"Channel {sub}", index, sub, data_type, pdo=True)
    return od


def socketcand(address):
    host, port = address.rsplit(":", 1)
    # Without tcp_tune, python-can holds small messages back until the last one is acknowledged.
    return {"interface": "socketcand", "host": host, "port": int(port), "channel": "can0", "tcp_tune": True}


def slcan(link):
    return {"interface": "slcan", "channel": link, "bitrate": 500_000, "sleep_after_open": 0}


def network():
    made = canopen.Network()
    # How long the receiving thread sleeps at most before it sees that it is to end.
    made.NOTIFIER_CYCLE = 0.05
    return made


def connect(made, bus):
    """Opens the bus. python-can takes the greeting of a socketcand server for damaged if a frame follows
    within one read; then again."""
    for _ in range(10):
        try:
            made.connect(**bus)
            break
        except can.CanError as error:
            print(f"connecting again: {error}", flush=True)
    check("connected", made.bus is not None)
    return made


def disconnect(made):
    for node in made.nodes.values():
        if isinstance(node, canopen.LocalNode):
            node.nmt.stop_heartbeat()
    try:
        made.disconnect()
    except (can.CanError, OSError):
        # The adapter's process has ended, and its line with it.
        pass
