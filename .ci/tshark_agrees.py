#!/usr/bin/env python3
"""Compares `motionctl --json decode` with tshark, frame by frame: service, node, index, sub-index,
command, data. Every kind of difference is listed with its reason; one without a reason fails.

    tshark_agrees.py MOTIONCTL [--has KIND,KIND...] FILE...

--has: every file must have frames of these kinds (of SDO, also the commands), so that agreement says something.
"""
import collections
import json
import os
import subprocess
import sys
import tempfile

FIELDS = [
    "canopen.node_id", "canopen.sdo.main_idx", "canopen.sdo.sub_idx", "canopen.sdo.data.bytes",
    "canopen.sdo.toggle", "canopen.sdo.abort_code", "canopen.nmt_ctrl.cd", "canopen.nmt_ctrl.node_id",
    "canopen.nmt_guard.state", "canopen.nmt_guard.toggle", "canopen.em.err_code", "canopen.em.err_reg",
    "canopen.pdo.data.bytes", "canopen.time_stamp_ms", "canopen.time_stamp_days", "_ws.col.Info",
]
COMMANDS = {1: "start", 2: "stop", 0x80: "enter-pre-operational", 0x81: "reset-node", 0x82: "reset-communication"}
STATES = {0: "boot-up", 4: "stopped", 5: "operational", 0x7F: "pre-operational"}

# What tshark calls the services, by the start of its Info column.
SERVICES = [
    ("NMT", {"nmt"}), ("SYNC", {"sync"}), ("TIME STAMP", {"time"}), ("EMCY", {"emcy"}), ("PDO", {"pdo"}),
    ("Default-SDO", {"sdo-request", "sdo-response", "sdo-abort"}),
    ("Default SDO", {"sdo-request", "sdo-response", "sdo-abort"}),
    ("SDO", {"sdo-request", "sdo-response", "sdo-abort"}),
    ("Boot-up", {"boot-up"}), ("LSS", {"lss"}),
]


def number(text):
    text = (text or "").split(",")[0]
    return int(text, 0) if text else None


def ours(motionctl, path):
    """Frame objects; a candump log of them for tshark, which reads neither screen text nor .trc 1.1."""
    lines = subprocess.run([motionctl, "--json", "decode", path], capture_output=True, text=True, check=True).stdout
    return [frame for frame in map(json.loads, lines.splitlines()) if "id" in frame and "rtr" in frame]


def as_log(frames, out):
    for at, frame in enumerate(frames):
        width = 8 if frame["ext"] else 3
        ident = f"{frame['id']:0{width}X}"
        data = f"R{frame['dlc']}" if frame["rtr"] else frame["data"]
        out.write(f"({at}.000000) can0 {ident}#{data}\n")


def theirs(path):
    command = ["tshark", "-r", path, "-d", "can.subdissector,canopen", "-T", "fields", "-E", "separator=|"]
    for field in FIELDS:
        command += ["-e", field]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return [dict(zip(FIELDS, line.split("|"))) for line in text.splitlines()]


def difference(frame, seen):
    """Why the two do not agree; None where they do."""
    info = seen["_ws.col.Info"]
    kind = frame["kind"]
    if not same_service(info, kind):
        return f"service: tshark says {info.split(':')[0].split('0x')[0].strip()!r}, here {kind}"
    # tshark's field, ours, and how theirs becomes ours.
    same = int
    for field, key, convert in [
        ("canopen.nmt_ctrl.cd", "command", COMMANDS.get), ("canopen.nmt_ctrl.node_id", "node", same),
        ("canopen.nmt_guard.state", "state", STATES.get), ("canopen.sdo.main_idx", "index", same),
        ("canopen.sdo.sub_idx", "subindex", same), ("canopen.sdo.toggle", "toggle", same),
        ("canopen.sdo.abort_code", "code", same), ("canopen.em.err_code", "code", same),
        ("canopen.em.err_reg", "register", same), ("canopen.time_stamp_ms", "ms", same),
        ("canopen.time_stamp_days", "days", same),
    ]:
        value = number(seen[field])
        if value is not None and convert(value) != frame.get(key):
            return f"{key} ({kind}, {frame.get('command', info)})"
    if kind == "guard-reply" and number(seen["canopen.nmt_guard.toggle"]) != frame["toggle"]:
        return "toggle (guard-reply)"
    node = number(seen["canopen.node_id"])
    if node is not None and kind != "nmt" and node != frame.get("node", node):
        return f"node ({kind})"
    for field in ["canopen.sdo.data.bytes", "canopen.pdo.data.bytes"]:
        if seen[field].replace(":", "").upper() not in frame["data"]:
            return f"data ({kind})"
    if kind in ("sdo-request", "sdo-response") and not same_command(info, frame.get("command", "")):
        return f"command: tshark says {info.split(': ')[-1]!r}, here {frame.get('command')}"
    return None


def same_command(info, command):
    words = info.split(": ")[-1].lower().replace(" request", "").replace(" response", "").replace(" ", "-")
    if "block-download" in words:
        return "block" in command and "upload" not in command
    if "block-upload" in words:
        return "block" in command and "download" not in command
    return words.replace("-segment", "") in command.replace("-segment", "")


def same_service(info, kind):
    if "Guarding" in info or "Heartbeat" in info or "Boot-up" in info or info.startswith("NMT Error"):
        return kind in {"heartbeat", "guard-reply", "guard-request", "boot-up"}
    for start, kinds in SERVICES:
        if start.lower() in info.lower():
            return kind in kinds
    return kind == "unknown"


# Start of a difference, and why it is one.
REASONS = [
    ("ms (unknown", "tshark takes 101h...17Fh for TIME, which is 100h alone"),
    ("service: tshark says 'ID', here guard-request", "tshark hands no remote frames to its CANopen dissector"),
    ("node (unknown, Unknown (0)", "tshark takes 001h...07Fh for NMT, which is 000h alone"),
    ("toggle (sdo-request, block-segment)", "tshark keeps no state, so it reads a segment of a block transfer as a "
     "frame with a command byte"),
    ("toggle (sdo-response, block-segment)", "as in requests"),
    ("command: tshark says 'Unknown (0x7)', here block-segment", "as in requests"),
    ("index (sdo-request, block-segment)", "as in requests"),
    ("index (sdo-response, block-segment)", "as in requests"),
]


def main():
    motionctl, *files = sys.argv[1:]
    wanted = set()
    if files[0] == "--has":
        wanted = set(files[1].split(","))
        files = files[2:]
    unexplained = 0
    for path in files:
        frames = ours(motionctl, path)
        with tempfile.NamedTemporaryFile("w", suffix=".log", delete=False) as log:
            as_log(frames, log)
        seen = theirs(log.name)
        os.unlink(log.name)
        missing = wanted - {frame[key] for frame in frames for key in ("kind", "command") if key in frame}
        if missing:
            print(f"{os.path.basename(path)}: no frame of {', '.join(sorted(missing))}")
            unexplained += 1
        if len(seen) != len(frames):
            print(f"{os.path.basename(path)}: tshark gives {len(seen)} frames of {len(frames)}")
            unexplained += 1
            continue
        differences = collections.Counter(filter(None, map(difference, frames, seen)))
        agree = len(frames) - sum(differences.values())
        print(f"{os.path.basename(path)}: {len(frames)} frames, {agree} agree")
        for text, count in differences.most_common():
            reason = next((reason for start, reason in REASONS if text.startswith(start)), None)
            unexplained += reason is None
            print(f"    {count} x {text}: {reason or 'NO REASON KNOWN'}")
    sys.exit(1 if unexplained else 0)


main()
