"""python-canopen as master of our virtual nodes."""

import queue

import canopen

from common import LIMIT, SIZES, Inbox, check, connect, dictionary, disconnect, network, pattern, until

STATES = {"OPERATIONAL": 5, "STOPPED": 4, "PRE-OPERATIONAL": 127}


def python_is_master(bus, number, remote_frames):
    """Everything but LSS, with one virtual I/O node whose outputs are wired to its inputs."""
    net = connect(network(), bus)
    try:
        net.scanner.search()
        until("scan", lambda: net.scanner.nodes)
        node = canopen.RemoteNode(number, dictionary())
        net.add_node(node)
        node.sdo.RESPONSE_TIMEOUT = LIMIT
        check("device type", node.sdo[0x1000].raw, 0x000F0191)
        check("scan", net.scanner.nodes, [number])
        check("name", node.sdo[0x1008].raw, "Virtual I/O")
        transfers(node)
        network_management(net, node, number)
        outputs = process_data(net, node)
        emergency(net, node, outputs)
        boot_up(net, node, number)
        if remote_frames:
            guarding(net, number)
    finally:
        disconnect(net)


def transfers(node):
    for size in SIZES:
        data = pattern(size)
        node.sdo.download(0x2000, 2, data)
        check(f"SDO, {size} bytes", node.sdo.upload(0x2000, 2) == data)
    node.sdo.download(0x2000, 2, pattern(3), force_segment=True)
    check("forced segments", node.sdo.upload(0x2000, 2) == pattern(3))
    for crc in (True, False):
        for size in SIZES if crc else SIZES[4:10]:
            data = pattern(size)
            options = {"block_transfer": True, "request_crc_support": crc}
            with node.sdo.open(0x2000, 2, "wb", size=size, **options) as stream:
                stream.write(data)
            with node.sdo.open(0x2000, 2, "rb", **options) as stream:
                check(f"SDO block, {size} bytes, CRC {crc}", stream.read() == data)
    for what, code, action in [
        ("an object that is not there", 0x06020000, lambda: node.sdo.upload(0x5FFF, 0)),
        ("a subindex that is not there", 0x06090011, lambda: node.sdo.upload(0x1018, 9)),
        ("writing what is read-only", 0x06010002, lambda: node.sdo.download(0x1000, 0, bytes(4))),
        ("too long", 0x06070012, lambda: node.sdo.download(0x1017, 0, bytes(4))),
        ("too short", 0x06070013, lambda: node.sdo.download(0x1017, 0, bytes(1))),
    ]:
        try:
            action()
            check(what, "done")
        except canopen.SdoAbortedError as error:
            check(what, error.code, code)


def network_management(net, node, number):
    """Heartbeat, and each state as it shows."""
    heartbeats = Inbox(net, 0x700 + number)
    node.sdo[0x1017].raw = 50
    for name in ["OPERATIONAL", "STOPPED", "PRE-OPERATIONAL", "OPERATIONAL", "PRE-OPERATIONAL"]:
        node.nmt.state = name
        state = bytes([STATES[name]])
        heartbeats.wait_for(state)
        check(name, heartbeats.get(), state)
    heartbeats.close()


def process_data(net, node):
    node.tpdo.read()
    inputs = node.tpdo[1]
    inputs.clear()
    inputs.add_variable(0x6401, 1)
    inputs.add_variable(0x6000, 1)
    inputs.trans_type = 1
    inputs.enabled = True
    inputs.save()
    node.rpdo.read()
    outputs = node.rpdo[1]
    outputs.clear()
    outputs.add_variable(0x6200, 1)
    outputs.add_variable(0x6411, 1)
    outputs.trans_type = 255
    outputs.enabled = True
    outputs.save()
    check("mapping", [node.sdo[0x1A00][sub].raw for sub in range(3)], [2, 0x64010110, 0x60000108])
    received = queue.Queue()
    inputs.add_callback(lambda pdo: received.put([variable.raw for variable in pdo]))
    node.nmt.state = "OPERATIONAL"
    # That it is, the answer to a request after the command shows.
    check("operational", node.sdo[0x1001].raw, 0)
    for values in ([-1234, 0xA5], [32767, 0x5A]):
        outputs[1].raw, outputs[0].raw = values
        outputs.transmit()
        net.sync.transmit()
        check("TPDO after SYNC", received.get(timeout=LIMIT), values)
    net.sync.start(0.02)
    for _ in range(5):
        check("SYNC goes on", received.get(timeout=LIMIT), [32767, 0x5A])
    net.sync.stop()
    return outputs


def emergency(net, node, outputs):
    """An RPDO that is too short."""
    waiting = queue.Queue()
    node.emcy.add_callback(waiting.put)
    net.send_message(outputs.cob_id, b"\x01")
    check("EMCY", waiting.get(timeout=LIMIT).code, 0x8210)


def boot_up(net, node, number):
    for command in ("RESET", "RESET COMMUNICATION"):
        frames = Inbox(net, 0x700 + number)
        node.nmt.state = command
        check(command, frames.wait_for(b"\x00"), b"\x00")
        check("heartbeat is off again", node.sdo[0x1017].raw, 0)
        frames.close()


def guarding(net, number):
    answers = Inbox(net, 0x700 + number)
    for toggle in (0, 0x80, 0):
        net.send_message(0x700 + number, [], remote=True)
        check("guarding", answers.get(), bytes([127 | toggle]))


def python_is_lss_master(bus, serial):
    """Fastscan, node ID, store, with a device that has none."""
    net = connect(network(), bus)
    try:
        # A device that does not answer within this has a 1 in its identity.
        net.lss.RESPONSE_TIMEOUT = 0.8
        found, identity = net.lss.fast_scan()
        check("fastscan", (found, identity), (True, [0, 0x191, 1, serial]))
        net.lss.RESPONSE_TIMEOUT = LIMIT
        boot = Inbox(net, 0x700 + 42)
        net.lss.configure_node_id(42)
        net.lss.store_configuration()
        net.lss.send_switch_state_global(net.lss.WAITING_STATE)
        check("boot-up as node 42", boot.get(), b"\x00")
        node = net.add_node(42, dictionary())
        node.sdo.RESPONSE_TIMEOUT = LIMIT
        check("node 42", node.sdo[0x1018][4].raw, serial)
        check("select", net.lss.send_switch_state_selective(0, 0x191, 1, serial))
        check("node ID", net.lss.inquire_node_id(), 42)
        address = [net.lss.inquire_lss_address(command) for command in (0x5A, 0x5B, 0x5C, 0x5D)]
        check("LSS address", address, [0, 0x191, 1, serial])
        net.lss.send_switch_state_global(net.lss.WAITING_STATE)
    finally:
        disconnect(net)
