#!/usr/bin/env python3
"""Whether python-canopen finds in the device files that motionctl writes what it finds in the originals:
every attribute of every object, the device's information, the comments. A table of the outcome per file.

An EDS or DCF is converted without a change and `--anew`, an XDD or XDC into an EDS or DCF, of which
python-canopen must find the objects that motionctl names.

usage: eds_same_objects.py PATH-OF-MOTIONCTL FOLDER
"""

import collections
import json
import logging
import os
import subprocess
import sys
import tempfile

import canopen
from canopen.objectdictionary import ODVariable

NODE = 5
# Words that the standard does not have and python-canopen keeps; motionctl writes the standard's.
ACCESS = {"'r'": "'ro'", "'w'": "'wo'"}


def motionctl(*arguments):
    return subprocess.run([MOTIONCTL, "--json", *arguments], capture_output=True, text=True, timeout=60)


def attributes(thing):
    """Every attribute but the links to other objects, by name. NaN, which equals nothing, as text."""
    skipped = {"parent", "subindices", "names", "indices"}
    return {name: repr(value) for name, value in vars(thing).items() if name not in skipped}


def content(path):
    """What python-canopen reads: (index, sub-index) to attributes; None for what concerns the file."""
    dictionary = canopen.import_od(path, NODE)
    about = {"bitrate": dictionary.bitrate, "node_id": dictionary.node_id, "comments": dictionary.comments,
             "device": attributes(dictionary.device_information)}
    found = {None: about}
    for index, entry in dictionary.indices.items():
        found[index, None] = dict(attributes(entry), kind=type(entry).__name__)
        if not isinstance(entry, ODVariable):
            found.update({(index, sub): attributes(part) for sub, part in entry.subindices.items()})
    return found


def read(path):
    """Content, and why there is none."""
    try:
        return content(path), None
    except Exception as error:  # whatever python-canopen raises is its refusal
        return None, f"{type(error).__name__}: {error}".splitlines()[0][:80]


def differences(original, ours):
    for place in sorted(original.keys() | ours.keys(), key=str):
        there, here = original.get(place), ours.get(place)
        if there is None or here is None:
            yield f"{name_of(place)} is only in {'ours' if there is None else 'the original'}"
            continue
        for key in sorted(there.keys() | here.keys()):
            if there.get(key) != here.get(key):
                yield f"{name_of(place)} {key}: {there.get(key)} in the original, {here.get(key)} in ours"


def explained(text, original):
    """Why a file written anew may differ."""
    if "access_type: " in text and any(f"access_type: {odd} in the original, {word} in ours" in text
                                       for odd, word in ACCESS.items()):
        return "access in the standard's word"
    if text.startswith("file node_id: None") and b"[devicecommissioning]" in open(original, "rb").read().lower():
        return "python-canopen finds the node ID, [DeviceComissioning] being spelled as in the standard"
    return None


def name_of(place):
    if place is None:
        return "file"
    index, sub = place
    return f"{index:04X}h" if sub is None else f"{index:04X}h:{sub:02X}"


def examine(path, folder):
    """Outcome in a word or two; details, empty where all is well."""
    checked = json.loads(motionctl("eds", "check", "--lenient", path).stdout)
    if checked["refused"]:
        peer = "-" if path.lower().endswith(("x", "xpd", "xdd", "xdc", "xml")) else str(read(path)[1])
        details = [] if peer != "None" else ["python-canopen reads what motionctl refuses"]
        return f"refused: {checked['diagnostics'][0]['message']}; python-canopen: {peer}", details
    suffix = {"EDS": "eds", "XDD": "eds", "DCF": "dcf", "XDC": "dcf"}[checked["format"]]
    summary = f"{checked['format']}, {checked['objects']} objects, {checked['entries']} entries"
    if checked["format"] in ("XDD", "XDC"):
        ours = os.path.join(folder, f"ours.{suffix}")
        converted = motionctl("eds", "convert", path, ours)
        if converted.returncode:
            return summary, [converted.stderr.strip()]
        found, refused = read(ours)
        shown = json.loads(motionctl("eds", "show", path).stdout)["objects"]
        if refused and "AccessType" in refused and any(
                entry["access"] is None for item in shown for entry in item["entries"]):
            return f"{summary}; has no access of some values, which python-canopen wants", []
        if refused:
            return summary, [f"python-canopen does not read ours: {refused}"]
        # Below are data types that [DummyUsage] names.
        read_there = {place[0] for place in found if place and place[0] >= 0x1000}
        return f"{summary}; as {suffix.upper()} the same objects", [
            f"{index:04X}h is not in both" for index in sorted({item["index"] for item in shown} ^ read_there)]
    # python-canopen goes by the name; what is in the file decides here.
    link = os.path.join(folder, f"original.{suffix}")
    if os.path.lexists(link):
        os.unlink(link)
    os.symlink(path, link)
    original, refused = read(link)
    details = []
    words = []
    for how, options in [("unchanged", []), ("anew", ["--anew"])]:
        ours = os.path.join(folder, f"{how}.{suffix}")
        converted = motionctl("eds", "convert", *options, path, ours)
        if converted.returncode:
            details.append(f"{how}: {converted.stderr.strip()}")
            continue
        found, why = read(ours)
        if original is None:
            words.append(f"{how}: {'also refused' if why else 'read'}")
        elif why:
            details.append(f"{how}: python-canopen reads the original and not ours: {why}")
        else:
            reasons = collections.Counter()
            wrong = []
            for text in differences(original, found):
                reason = explained(text, path) if how == "anew" else None
                if reason:
                    reasons[reason] += 1
                else:
                    wrong.append(f"{how}: {text}")
            details += wrong
            same = "same" if not wrong else f"{len(wrong)} differences"
            words.append(f"{how}: {same}" + "".join(f", but for {n} x {why}" for why, n in reasons.items()))
    if original is None:
        words.insert(0, f"python-canopen refuses the original ({refused})")
    return "; ".join([summary, *words]), details


def main():
    logging.disable(logging.CRITICAL)
    outcomes = collections.Counter()
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        for name in sorted(os.listdir(FOLDER)):
            outcome, details = examine(os.path.join(FOLDER, name), folder)
            print(f"{name} | {outcome}")
            for text in details[:10]:
                print(f"    {text}")
            failed += bool(details)
            kind = "refused" if outcome.startswith("refused") else outcome.split(",")[0]
            peer = " that python-canopen refuses" if "refuses the original" in outcome else ""
            outcomes[kind + peer] += 1
    print("; ".join(f"{count} {what}" for what, count in sorted(outcomes.items())) + f"; {failed} differ")
    sys.exit(1 if failed else 0)


MOTIONCTL, FOLDER = map(os.path.abspath, sys.argv[1:])
main()
