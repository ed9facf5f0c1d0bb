"""Ranks the tosses of recordings, and writes the manifest of the best ones.

python examples/rank_my_bag.py session.mcap [more.mcap ...] [--body brick.yaml] [--top 8] [--out manifest.parquet]
"""

import argparse

import contact_curation as cc
from contact_curation.contact.body import CONTACTNETS_CUBE

parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
parser.add_argument("inputs", nargs="+", help="MCAP files, rosbag2 folders, ROS 1 bags")
parser.add_argument("--body", help="what was tossed, a YAML file (default: ContactNets' cube)")
parser.add_argument("--top", type=int, default=8, help="how many tosses are selected")
parser.add_argument("--out", default="manifest.parquet", help="a .parquet, .csv or .json file")
arguments = parser.parse_args()

body = cc.Body.from_file(arguments.body) if arguments.body else CONTACTNETS_CUBE
tosses = cc.read(arguments.inputs, body=body)
for line in tosses.warnings:
    print(f"warning: {line}")
for one in tosses.rejected:
    print(f"rejected: {one.toss.toss_id}: {one.reasons[0]}")

ranking = cc.rank(tosses, top=arguments.top)
print(ranking)
ranking.save(arguments.out)
print(f"{len(ranking.selected)} tosses selected: {arguments.out}")
