"""Time to equal foveal error: Fovea's study beside results of with_cycles.py and with_luxcore.py.

    python compare.py STUDY_FOLDER RESULT.json... [--error 0.05]

Prints a Markdown table. Seconds are of the processor over all threads, which a loaded machine changes least; loading and building are
left out on all sides. A curve that ends above the error is taken on as one over the samples, and marked with a star.
"""

import argparse
import collections
import csv
import json
import math
import os
import statistics


def parse():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study")
    parser.add_argument("results", nargs="+")
    parser.add_argument("--error", type=float, default=0.05)
    return parser.parse_args()


def samples_at(curve, level):
    """Samples at which a falling curve reaches an error, and whether that is beyond its end."""
    points = sorted(curve.items())
    for (n0, e0), (n1, e1) in zip(points, points[1:]):
        if e0 >= level >= e1 > 0:
            return math.exp(math.log(n0) + math.log(n1 / n0) * math.log(e0 / level) / math.log(e0 / e1)), False
    ends_below = points[0][1] < level
    n, e = points[0] if ends_below else points[-1]
    return n * e / level, True


def fovea(folder, scene, method, level):
    """Processor seconds of one of Fovea's methods at the scene's first gaze."""
    curve = collections.defaultdict(list)
    with open(os.path.join(folder, "curves.csv")) as file:
        for row in csv.DictReader(file):
            if (row["scene"], row["gaze"], row["method"]) == (scene, "0_0", method) and row["film_fovea"]:
                curve[int(row["samples"])].append(float(row["film_fovea"]))
    costs = []
    with open(os.path.join(folder, "rates.csv")) as file:
        for row in csv.DictReader(file):
            if (row["scene"], row["gaze"], row["method"]) == (scene, "0_0", method) and row["cpu_s"]:
                costs.append(float(row["cpu_s"]) / float(row["samples"]))
    if not curve or not costs:
        return None
    samples, beyond = samples_at({n: statistics.mean(errors) for n, errors in curve.items()}, level)
    return samples * statistics.median(costs), beyond


def peer(result, way, level):
    """Processor seconds of one way of a peer."""
    if way not in result:
        return None
    samples, beyond = samples_at({float(n): e for n, e in result[way]["error"].items()}, level)
    return samples * result[way]["cpu_s_a_sample"], beyond


def main():
    arguments = parse()
    names = ["OD", "FV", "best", "panorama", "border or brush", "panorama over FV", "panorama over best", "border over FV"]
    print("| scene | peer | " + " | ".join(names) + " |\n|" + "---|" * (len(names) + 2))
    for path in arguments.results:
        with open(path) as file:
            result = json.load(file)
        scene = os.path.splitext(result["scene"])[0]
        ours = [fovea(arguments.study, scene, method, arguments.error) for method in ("od", "fv", "fv-best")]
        by_hand = "border" if "border" in result else "brush"
        theirs = [peer(result, way, arguments.error) for way in ("panorama", by_hand)]
        text = lambda found: "-" if found is None else f"{found[0]:.3g}{'*' if found[1] else ''}"
        ratio = lambda a, b: "-" if a is None or b is None else f"{a[0] / b[0]:.3g}"
        cells = [text(found) for found in ours + theirs]
        cells += [ratio(theirs[0], ours[1]), ratio(theirs[0], ours[2]), ratio(theirs[1], ours[1])]
        print(f"| {scene} | {result['renderer']} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
