"""Checks recordings before anything is computed from them: one verdict each, its reasons, and what to do.

    python examples/check_recordings.py session.mcap [more.mcap ...] [--body brick.yaml]

The exit status is 1 if a recording has a fault, so that a script that records can stop there.
"""

import argparse
import sys

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE

parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
parser.add_argument("inputs", nargs="+", help="MCAP files, rosbag2 folders, ROS 1 bags")
parser.add_argument("--body", help="what was tossed, a YAML file (default: ContactNets' cube)")
arguments = parser.parse_args()

body = cc.Body.from_file(arguments.body) if arguments.body else CONTACTNETS_CUBE
faulty = 0
for path in arguments.inputs:
    diagnosis = cc.check(path, body=body)
    print(f"{path}: {diagnosis.verdict}")
    for reason in diagnosis.reasons:
        print(f"    {reason}")
    if diagnosis.settings:
        print(f"    correct it with: {diagnosis.settings}")
    faulty += not diagnosis.ok
sys.exit(faulty > 0)
