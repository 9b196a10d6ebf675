"""The measurement of `.ci/decode_peers`: MOTIONCTL WORK SIZE; or `loop FILE`, the Python contender."""
import os
import random
import subprocess
import sys
import time

SEED = 1
ROUNDS = 3
# What the slow ones get: the start of the same file.
SAMPLES = {"tshark": 60_000, "python": 60_000}


def generate(path, size):
    """Eight drives on a bus at 500 kbit/s: SYNC, three PDOs each, heartbeats, polling by SDO, emergencies."""
    rng = random.Random(SEED)
    now, cycle, frames, written = 1682489978.0, 0, 0, 0
    with open(path, "w", buffering=1 << 20) as out:
        while written < size:
            lines = []

            def say(ident, data):
                nonlocal now
                now += 0.000230
                lines.append(f"({now:.6f}) can0 {ident:03X}#{data}\n")

            say(0x80, "")
            for node in range(1, 9):
                say(0x180 + node, f"{rng.choice((0x3706, 0x2706)):04X}{rng.getrandbits(32):08X}")
                say(0x280 + node, f"{rng.getrandbits(64):016X}")
                say(0x200 + node, f"0F00{rng.getrandbits(32):08X}")
            if cycle % 10 == 0:
                for node in range(1, 9):
                    say(0x700 + node, "05")
            node = 1 + cycle % 8
            say(0x600 + node, "4041600000000000")
            say(0x580 + node, f"4B4160003706{rng.getrandbits(16):04X}")
            if cycle % 100 == 50:
                say(0x80 + node, "3081110000000000")
            cycle += 1
            text = "".join(lines)
            frames += len(lines)
            written += len(text)
            out.write(text)
    return frames


def loop(path):
    """What a script does with the two libraries: read, hand to the network, print what it is."""
    import json
    import can
    import canopen

    kinds = {0: "nmt", 1: "sync", 3: "pdo", 4: "pdo", 5: "pdo", 6: "pdo", 7: "pdo", 8: "pdo", 9: "pdo", 10: "pdo",
             11: "sdo-response", 12: "sdo-request", 14: "heartbeat"}
    network = canopen.Network()
    for node in range(1, 9):
        network.add_node(canopen.RemoteNode(node, canopen.ObjectDictionary()))
    for message in can.LogReader(path):
        ident, data = message.arbitration_id, message.data
        network.notify(ident, data, message.timestamp)
        kind = kinds.get(ident >> 7, "unknown")
        fields = {"t": message.timestamp, "bus": message.channel, "id": ident, "ext": message.is_extended_id,
                  "rtr": message.is_remote_frame, "data": data.hex().upper(), "node": ident & 0x7F, "kind": kind}
        if kind.startswith("sdo"):
            fields["index"], fields["subindex"] = data[1] | data[2] << 8, data[3]
        sys.stdout.write(json.dumps(fields) + "\n")


def run(command):
    """Processor time, clock time, largest memory in MB."""
    start = time.perf_counter()
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    clock = time.perf_counter() - start
    assert status == 0, command
    return usage.ru_utime + usage.ru_stime, clock, usage.ru_maxrss / 1024


def head(path, lines, out):
    with open(path) as source, open(out, "w") as sink:
        for _, line in zip(range(lines), source):
            sink.write(line)


def main(motionctl, work, size):
    log = os.path.join(work, "bus.log")
    frames = generate(log, size)
    paths = {"motionctl": log}
    counts = {"motionctl": frames}
    for name, lines in SAMPLES.items():
        counts[name] = min(lines, frames)
        paths[name] = os.path.join(work, f"{name}.log")
        head(log, lines, paths[name])
    commands = {
        "motionctl": [motionctl, "--json", "decode", paths["motionctl"]],
        "tshark": ["tshark", "-r", paths["tshark"], "-d", "can.subdissector,canopen", "-T", "json"],
        "python": [sys.executable, __file__, "loop", paths["python"]],
    }
    empty = os.path.join(work, "empty.log")
    head(log, 1, empty)
    # The time to start is not the time to decode: measured with one frame and taken off.
    idle = {name: run([empty if part == paths[name] else part for part in command])
            for name, command in commands.items()}
    rounds = [{name: run(command) for name, command in commands.items()} for _ in range(ROUNDS)]
    ratios = {"tshark": [], "python": []}
    print(f"{frames} frames, {os.path.getsize(log)} bytes, seed {SEED}; start-up taken off")
    for name in commands:
        cpu = sorted(counts[name] / max(one[name][0] - idle[name][0], 1e-3) for one in rounds)[ROUNDS // 2]
        clock = sorted(counts[name] / max(one[name][1] - idle[name][1], 1e-3) for one in rounds)[ROUNDS // 2]
        memory = max(one[name][2] for one in rounds)
        print(f"{name:10} {cpu:12.0f} frames/s of processor time, {clock:12.0f} by the clock, {memory:8.1f} MB")
    for one in rounds:
        rate = {name: counts[name] / max(one[name][0] - idle[name][0], 1e-3) for name in commands}
        for name in ratios:
            ratios[name].append(rate["motionctl"] / rate[name])
    least = {"tshark": 20, "python": 100}
    met = True
    for name, values in ratios.items():
        value = sorted(values)[ROUNDS // 2]
        met &= value >= least[name]
        print(f"{value:6.0f} x {name} (at least {least[name]} expected)")
    sys.exit(0 if met else 1)


if sys.argv[1] == "loop":
    loop(sys.argv[2])
else:
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
