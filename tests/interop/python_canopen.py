#!/usr/bin/env python3
"""motionctl against python-canopen and python-can, both ways, over socketcand and over slcan on a
pseudo-terminal: scan, SDO in every mode that the peer has, PDO mapping, NMT, SYNC, EMCY, heartbeat,
guarding, LSS.

usage: python_canopen.py PATH-OF-MOTIONCTL
"""

import json
import os
import queue
import subprocess
import sys
import tempfile
import threading
import time

import can
import canopen
from canopen.objectdictionary import (
    INTEGER16, UNSIGNED8, UNSIGNED16, UNSIGNED32, ODRecord, ODVariable, ObjectDictionary, datatypes)

MOTIONCTL = os.path.abspath(sys.argv[1])
SIZES = [1, 2, 3, 4, 5, 7, 8, 100, 889, 890, 10_000, 100_000]
passed = 0


def check(what, found, expected=True):
    global passed
    if found != expected:
        raise AssertionError(f"{what}: {found!r}, expected {expected!r}")
    passed += 1


def pattern(size):
    return bytes((i * 7 + size) & 0xFF for i in range(size))


class Process:
    """motionctl, running until it is left."""

    def __init__(self, *arguments):
        self.process = subprocess.Popen([MOTIONCTL, "--json", *arguments], stdout=subprocess.PIPE, text=True)
        self.ready = json.loads(self.process.stdout.readline())

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(10)


def motionctl(*arguments, status=0, timeout=60):
    done = subprocess.run([MOTIONCTL, "--json", *arguments], capture_output=True, text=True, timeout=timeout)
    if done.returncode != status:
        raise AssertionError(f"{arguments}: status {done.returncode}, {done.stdout}{done.stderr}")
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
    for communication, mapping in [(0x1400, 0x1600), (0x1800, 0x1A00)]:
        record = ODRecord(f"Communication {communication:X}", communication)
        od.add_object(record)
        variable(record, "Count", communication, 0, UNSIGNED8, default=6)
        variable(record, "COB-ID", communication, 1, UNSIGNED32)
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


def connect(**bus):
    network = canopen.Network()
    network.connect(**bus)
    return network


def python_is_master(bus, io_node, remote_frames, sizes):
    """python-canopen as master of one virtual I/O node."""
    network = connect(**bus)
    try:
        network.scanner.search()
        time.sleep(0.5)
        check("scan", io_node in network.scanner.nodes)
        node = canopen.RemoteNode(io_node, dictionary())
        network.add_node(node)
        node.sdo.RESPONSE_TIMEOUT = 3
        check("device type", node.sdo[0x1000].raw, 0x000F0191)
        check("name", node.sdo[0x1008].raw, "Virtual I/O")
        for size in sizes:
            data = pattern(size)
            node.sdo.download(0x2000, 2, data)
            check(f"SDO, {size} bytes", node.sdo.upload(0x2000, 2) == data)
        node.sdo.download(0x2000, 2, pattern(300), force_segment=True)
        check("forced segments", node.sdo.upload(0x2000, 2) == pattern(300))
        for size in [*sizes[4:], SIZES[-1]]:
            data = pattern(size)
            with node.sdo.open(0x2000, 2, "wb", size=size, block_transfer=True) as stream:
                stream.write(data)
            with node.sdo.open(0x2000, 2, "rb", block_transfer=True) as stream:
                check(f"SDO block, {size} bytes", stream.read() == data)
        try:
            node.sdo.upload(0x5FFF, 0)
            check("an object that is not there", "read")
        except canopen.SdoAbortedError as error:
            check("an object that is not there", error.code, 0x06020000)

        # Heartbeat and NMT.
        node.sdo[0x1017].raw = 50
        for state in ["OPERATIONAL", "STOPPED", "PRE-OPERATIONAL", "OPERATIONAL"]:
            node.nmt.state = state
            node.nmt.wait_for_heartbeat(2)
            check("state", node.nmt.wait_for_heartbeat(2), state)
        node.nmt.state = "PRE-OPERATIONAL"

        # PDO mapping, SYNC.
        node.tpdo.read()
        pdo = node.tpdo[1]
        pdo.clear()
        pdo.add_variable(0x6401, 1)
        pdo.add_variable(0x6000, 1)
        pdo.trans_type = 1
        pdo.enabled = True
        pdo.save()
        node.rpdo.read()
        outputs = node.rpdo[1]
        outputs.clear()
        outputs.add_variable(0x6200, 1)
        outputs.add_variable(0x6411, 1)
        outputs.trans_type = 255
        outputs.enabled = True
        outputs.save()
        node.nmt.state = "OPERATIONAL"
        outputs[0].raw, outputs[1].raw = 0xA5, -1234
        outputs.transmit()
        time.sleep(0.05)
        network.sync.transmit()
        check("TPDO after SYNC", pdo.wait_for_reception(2) is not None)
        check("mapped values", (pdo[0].raw, pdo[1].raw), (-1234, 0xA5))
        received = pdo.timestamp
        network.sync.start(0.02)
        time.sleep(0.5)
        network.sync.stop()
        check("SYNC goes on", pdo.timestamp > received)

        # An emergency: an RPDO that is too short.
        waiting = queue.Queue()
        node.emcy.add_callback(waiting.put)
        network.send_message(outputs.cob_id, b"\x01")
        check("EMCY", waiting.get(timeout=2).code, 0x8210)

        # Boot-up.
        booted = threading.Thread(target=node.nmt.wait_for_bootup, args=(3,))
        booted.start()
        time.sleep(0.1)
        node.nmt.state = "RESET"
        booted.join()
        if remote_frames:
            answers = queue.Queue()
            network.subscribe(0x700 + io_node, lambda _, data, __: answers.put(data[0]))
            for toggle in (0, 0x80, 0):
                network.send_message(0x700 + io_node, [], remote=True)
                check("guarding", answers.get(timeout=2), 127 | toggle)
    finally:
        network.disconnect()


def python_is_lss_master(bus):
    """Fastscan, node ID, store, with a device that has none."""
    network = connect(**bus)
    try:
        network.lss.RESPONSE_TIMEOUT = 0.5
        found, identity = network.lss.fast_scan()
        check("fastscan", (found, identity), (True, [0, 0x191, 1, 77]))
        network.lss.configure_node_id(42)
        network.lss.store_configuration()
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
        node = network.add_node(42, dictionary())
        node.sdo.RESPONSE_TIMEOUT = 3
        check("node 42", node.sdo[0x1018][4].raw, 77)
        check("select", network.lss.send_switch_state_selective(0, 0x191, 1, 77))
        check("node ID", network.lss.inquire_node_id(), 42)
        network.lss.send_switch_state_global(network.lss.WAITING_STATE)
    finally:
        network.disconnect()


def local_node(network, number):
    node = canopen.LocalNode(number, dictionary())
    network.add_node(node)
    node.nmt.state = "INITIALISING"
    node.nmt.state = "PRE-OPERATIONAL"
    node.nmt.start_heartbeat(50)
    return node


def motionctl_is_master(endpoint, bus):
    """motionctl with a local node of python-canopen on the same bus."""
    network = connect(**bus)
    try:
        node = local_node(network, 20)
        line = ["--can", endpoint]
        [scan] = motionctl("can", "scan", "--timeout", "0.3", *line)
        [found] = [entry for entry in scan["nodes"] if entry["node"] == 20]
        check("scan", (found["profile"], found["name"]), (0x2345, "python node"))
        check("identity", found["identity"], {"vendor": 0x11, "product": 0x22, "revision": 0x33, "serial": 0x44})
        check("state", found["state"], "pre-operational")
        with tempfile.TemporaryDirectory() as directory:
            path, back = os.path.join(directory, "data"), os.path.join(directory, "back")
            for size in SIZES:
                with open(path, "wb") as file:
                    file.write(pattern(size))
                [written] = motionctl("can", "sdo", "write", "20", "0x2000:1", "--file", path, "--timeout", "3", *line)
                check("mode", written["mode"], "expedited" if size <= 4 else "segmented")
                check("there", bytes(node.data_store[0x2000][1]) == pattern(size))
                motionctl("can", "sdo", "read", "20", "0x2000:1", "--output", back, "--timeout", "3", *line)
                check(f"back, {size} bytes", open(back, "rb").read() == pattern(size))
        [refused] = motionctl("can", "sdo", "read", "20", "0x5FFF", *line, status=4)
        check("abort", refused["abort_code"], 0x06020000)
        for command, state in [("start", "OPERATIONAL"), ("stop", "STOPPED"), ("preop", "PRE-OPERATIONAL")]:
            [shown] = motionctl("can", "nmt", command, "20", *line)
            check("confirmed", shown["confirmed"], [20])
            check("its own state", node.nmt.state, state)
        listen_to(network, node, lambda: motionctl("can", "emcy", "--for", "2", *line))
    finally:
        network.disconnect()


def listen_to(network, node, run):
    """An emergency that comes while motionctl listens."""
    def send():
        for _ in range(6):
            time.sleep(0.25)
            node.emcy.send(0x2310, 0x03, b"\x01\x02\x03\x04\x05")
    sender = threading.Thread(target=send)
    sender.start()
    lines = run()
    sender.join()
    entry = {key: lines[0][key] for key in ("node", "code", "register", "data")}
    check("EMCY", entry, {"node": 20, "code": 0x2310, "register": 3, "data": "0102030405"})


def slcan(link):
    return {"interface": "slcan", "channel": link, "bitrate": 500_000, "sleep_after_open": 0}


def wait_for(link):
    end = time.time() + 10
    while not os.path.exists(link) and time.time() < end:
        time.sleep(0.02)
    time.sleep(0.05)


def motionctl_is_master_and_adapter(link):
    """The same over slcan: motionctl is the adapter, one process for each command."""
    def against(arguments, status=0, act=None):
        result = {}
        def run():
            result["lines"] = motionctl(*arguments, "--can", f"slcan-pty:{link}", status=status)
        thread = threading.Thread(target=run)
        thread.start()
        wait_for(link)
        network = connect(**slcan(link))
        try:
            node = local_node(network, 20)
            if act:
                act(network, node)
            thread.join(60)
        finally:
            try:
                network.disconnect()
            except can.CanError:
                # The adapter's process has ended, and its line with it.
                pass
        # The pseudo-terminal goes with its process.
        end = time.time() + 5
        while os.path.lexists(link) and time.time() < end:
            time.sleep(0.02)
        return result["lines"], node

    ([scan], _) = against(["can", "scan", "--nodes", "18-22", "--timeout", "1"])
    check("scan", [(entry["node"], entry["name"]) for entry in scan["nodes"]], [(20, "python node")])
    with tempfile.TemporaryDirectory() as directory:
        path = os.path.join(directory, "data")
        for size in (1, 4, 5, 10_000):
            with open(path, "wb") as file:
                file.write(pattern(size))
            (_, node) = against(["can", "sdo", "write", "20", "0x2000:1", "--file", path, "--timeout", "3"])
            check(f"SDO, {size} bytes", bytes(node.data_store[0x2000][1]) == pattern(size))
    ([shown], node) = against(["can", "nmt", "start", "20", "--timeout", "2"])
    check("NMT", (shown["confirmed"], node.nmt.state), ([20], "OPERATIONAL"))


def main():
    with Process("bus", "--listen", "127.0.0.1:0", "--bitrate", "1000000") as bus:
        address = bus.ready["listen"]
        host, port = address.rsplit(":", 1)
        endpoint = f"socketcand:{address}/can0"
        python = {"interface": "socketcand", "host": host, "port": int(port), "channel": "can0"}
        with Process("sim", "io", "--node", "5", "--wired", "--can", endpoint):
            # python-can's socketcand driver has no remote frames, its slcan driver is slow.
            python_is_master(python, 5, remote_frames=False, sizes=SIZES)
        print(f"socketcand, python-canopen master: {passed} checks passed", flush=True)
        with Process("sim", "io", "--node", "255", "--serial-number", "77", "--can", endpoint):
            python_is_lss_master(python)
        print(f"socketcand, LSS: {passed} checks passed", flush=True)
        motionctl_is_master(endpoint, python)
        print(f"socketcand, motionctl master: {passed} checks passed", flush=True)
    with tempfile.TemporaryDirectory() as directory:
        link = os.path.join(directory, "can")
        with Process("sim", "io", "--node", "5", "--wired", "--can", f"slcan-pty:{link}"):
            python_is_master(slcan(link), 5, remote_frames=True, sizes=SIZES[:-1])
        print(f"slcan, python-canopen master: {passed} checks passed", flush=True)
        with Process("sim", "io", "--node", "255", "--serial-number", "77", "--can", f"slcan-pty:{link}"):
            python_is_lss_master(slcan(link))
        print(f"slcan, LSS: {passed} checks passed", flush=True)
        motionctl_is_master_and_adapter(link)
        print(f"slcan, motionctl master: {passed} checks passed", flush=True)


if __name__ == "__main__":
    main()
    print(f"{passed} passed, 0 failed")
