"""motionctl as master of a local node of python-canopen."""

import os
import tempfile
import threading

import canopen

from common import (
    LIMIT, SIZES, Inbox, Process, check, connect, dictionary, disconnect, motionctl, network, pattern, slcan, until)

ANSWER = ["--timeout", str(LIMIT)]


def with_local_node(bus, data=None):
    """A network with the node there, and what was written to it before, before the first frame can come."""
    net = network()
    node = canopen.LocalNode(20, dictionary())
    node.data_store.update(data or {})
    net.add_node(node)
    node.nmt._state = 127
    return net, node, connect(net, bus)


def show_state(node):
    node.nmt.start_heartbeat(50)
    # A command that came meanwhile.
    node.nmt.update_heartbeat()


def transfers(run, node, sizes):
    """Every mode that python-canopen's server has: expedited, segments, and its answer to a block upload,
    which is a plain one; a block download it refuses."""
    with tempfile.TemporaryDirectory() as directory:
        path, back = os.path.join(directory, "data"), os.path.join(directory, "back")
        for size in sizes:
            with open(path, "wb") as file:
                file.write(pattern(size))
            [written] = run("can", "sdo", "write", "20", "0x2000:1", "--file", path, *ANSWER)
            mode = "expedited" if size <= 4 else "segmented"
            check("mode", written["mode"], mode)
            check(f"there, {size} bytes", node().data_store[0x2000][1] == pattern(size))
            for more in ([], ["--block"]):
                [read] = run("can", "sdo", "read", "20", "0x2000:1", "--output", back, *ANSWER, *more)
                with open(back, "rb") as file:
                    check(f"back, {size} bytes {more}", (file.read() == pattern(size), read["mode"]), (True, mode))
        with open(path, "wb") as file:
            file.write(pattern(100))
        [refused] = run("can", "sdo", "write", "20", "0x2000:1", "--block", "--file", path, *ANSWER, status=4)
        check("no blocks", refused["abort_code"], 0x05040001)


def motionctl_is_master(endpoint, bus):
    """On the same bus."""
    net, node, _ = with_local_node(bus)
    try:
        node.nmt.state = "INITIALISING"
        node.nmt.state = "PRE-OPERATIONAL"
        show_state(node)

        def run(*arguments, status=0):
            return motionctl(*arguments, "--can", endpoint, status=status)

        [scan] = run("can", "scan", "--timeout", "3")
        [found] = scan["nodes"]
        check("scan", (found["node"], found["profile"], found["name"]), (20, 0x2345, "python node"))
        check("identity", found["identity"], {"vendor": 0x11, "product": 0x22, "revision": 0x33, "serial": 0x44})
        check("state", found["state"], "pre-operational")
        transfers(run, lambda: node, SIZES)
        for code, arguments in [(0x06020000, ["read", "20", "0x5FFF"]), (0x06090011, ["read", "20", "0x1018:9"]),
                                (0x06010002, ["write", "20", "0x1000", "1", "--type", "u32"])]:
            [refused] = run("can", "sdo", *arguments, *ANSWER, status=4)
            check("abort", refused["abort_code"], code)
        for command, state in [("start", "OPERATIONAL"), ("stop", "STOPPED"), ("preop", "PRE-OPERATIONAL")]:
            [shown] = run("can", "nmt", command, "20", *ANSWER)
            check("confirmed", shown["confirmed"], [20])
            check("its own state", node.nmt.state, state)
        mapping(run, net, node)
        emergencies(endpoint, node)
        synchronisation(endpoint, net)
    finally:
        disconnect(net)


def mapping(run, net, node):
    """Our master writes the mapping; by it the node sends, and reads what we see."""
    objects = ["0x6401:1:16", "0x6000:1:8"]
    [set_up] = run("can", "pdo", "write", "20", "tpdo1", "--map", *objects, "--id", "0x194",
                   "--transmission", "1", *ANSWER)
    check("PDO", (set_up["id"], set_up["enabled"], set_up["transmission"]), (0x194, True, 1))
    stored = [int.from_bytes(node.data_store[0x1A00][sub], "little") for sub in range(3)]
    check("mapping", stored, [2, 0x64010110, 0x60000108])
    [read] = run("can", "pdo", "read", "20", "tpdo1", *ANSWER)
    check("read back", read, set_up)


def stream(arguments, act):
    """The first line of a stream, for which `act` does something again and again until it comes."""
    with Process(*arguments) as process:
        done = threading.Event()

        def again():
            while not done.wait(0.05):
                act()

        thread = threading.Thread(target=again)
        thread.start()
        try:
            return process.line()
        finally:
            done.set()
            thread.join()


def emergencies(endpoint, node):
    """An emergency that comes while motionctl listens."""
    line = stream(["can", "emcy", "--for", str(4 * LIMIT), "--can", endpoint],
                  lambda: node.emcy.send(0x2310, 0x03, b"\x01\x02\x03\x04\x05"))
    entry = {key: line[key] for key in ("node", "code", "register", "data")}
    check("EMCY", entry, {"node": 20, "code": 0x2310, "register": 3, "data": "0102030405"})


def synchronisation(endpoint, net):
    """A whole controller as SYNC producer: with one of its objects active, it works on the bus."""
    syncs = Inbox(net, 0x80)
    with tempfile.TemporaryDirectory() as directory:
        config = os.path.join(directory, "config.toml")
        with open(config, "w") as file:
            file.write(f'[controller]\nmodel = 8230\n[can1]\nendpoint = "{endpoint}"\n[parameters]\n326 = "Digital"\n')
        with Process("run", config):
            check("SYNC", [syncs.get() for _ in range(5)], [b""] * 5)
    syncs.close()


def motionctl_is_master_and_adapter(link):
    """The same over slcan: motionctl is the adapter, one process for each command."""
    node = None

    def against(*arguments, status=0):
        nonlocal node
        result = {}

        def run():
            try:
                result["lines"] = motionctl(*arguments, "--can", f"slcan-pty:{link}", status=status)
            except Exception as error:
                result["error"] = error

        thread = threading.Thread(target=run)
        thread.start()
        until("the adapter", lambda: os.path.exists(link) or not thread.is_alive())
        if "error" in result:
            raise result["error"]
        net, node, _ = with_local_node(slcan(link), node and node.data_store)
        try:
            if "nmt" in arguments:
                show_state(node)
            thread.join(4 * LIMIT)
        finally:
            disconnect(net)
        # The pseudo-terminal goes with its process.
        until("the adapter's end", lambda: not os.path.lexists(link))
        if "lines" not in result:
            raise result.get("error", AssertionError(f"{arguments}: no end"))
        return result["lines"]

    [scan] = against("can", "scan", "--nodes", "18-22", "--timeout", "3")
    check("scan", [(entry["node"], entry["name"]) for entry in scan["nodes"]], [(20, "python node")])
    transfers(against, lambda: node, [1, 2, 3, 4, 5, 100, 10_000])
    [shown] = against("can", "nmt", "start", "20", *ANSWER)
    check("NMT", (shown["confirmed"], node.nmt.state), ([20], "OPERATIONAL"))
