"""Efficiency over a whole panorama, Fovea's OD and Blender Cycles in turn: relative mean squared error times seconds.

    python whole_panorama.py SCENE.glb OUT.json --fovea target/debug/fovea [--spp 16 64] [--seeds 8] [--max-bounces 8]

Needs `bpy` (5.x) and `OpenEXR` from PyPI. Same film, camera, bounces, background and cores; renders of the two alternate, seed by seed.
Both estimates are unbiased, so an error is the variance of a pixel over the seeds, divided by the same squared luminance as in
common.py and averaged by solid angle: no reference is needed. Seconds are the clock's: the tracing's of Fovea, the slope between fewest
and most samples of Cycles, so that neither is charged for loading and building.
"""

import json
import math
import os
import subprocess
import tempfile

import bpy
import numpy as np
import OpenEXR

import common
import with_cycles


def parse():
    parser = common.parser(__doc__, seeds=8)
    parser.add_argument("--fovea", required=True)
    parser.add_argument("--sequence", nargs="+", default=["sobol", "independent"])
    parser.set_defaults(spp=[16, 64], max_bounces=8, background=[0, 0, 0])
    return parser.parse_args()


def fovea(arguments, spp, seed, sequence):
    """Pixels and what `--json` reports."""
    width, height = arguments.size
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "film.exr")
        command = [
            arguments.fovea, "render", arguments.scene, "-o", path, "--mode", "od", "--spp", str(spp), "--seed", str(seed),
            "--sequence", sequence, "--camera", str(arguments.camera), "--orient", "camera",
            "--film", f"equirect:{width}x{height}", "--max-bounces", str(arguments.max_bounces),
            "--background", ",".join(map(str, arguments.background)), "--json",
        ]
        run = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL).stdout)
        with OpenEXR.File(path) as file:
            channels = file.channels()
            name = next(name for name in ("RGB", "RGBA") if name in channels)
            return np.array(channels[name].pixels[..., :3], float), run


def error(pictures):
    """Relative mean squared error of one picture, from the variance over the seeds, and its standard error (jackknife)."""
    height = pictures[0].shape[0]
    weight = np.cos((np.arange(height) + 0.5) / height * math.pi - 0.5 * math.pi)[:, None]

    def of(pictures):
        stack = np.array(pictures)
        both = common.luminance(stack.mean(0))
        padded = np.pad(both, 1, mode="edge")
        rows, columns = both.shape
        smooth = sum(padded[j:j + rows, i:i + columns] for j in range(3) for i in range(3)) / 9
        divisor = smooth ** 2 + (0.1 * (weight * both).sum() / (weight.sum() * columns)) ** 2
        return float((weight * stack.var(0, ddof=1).mean(-1) / divisor).sum() / (weight.sum() * columns))

    whole, n = of(pictures), len(pictures)
    left_out = [of(pictures[:i] + pictures[i + 1:]) for i in range(n)]
    return whole, math.sqrt((n - 1) / n * sum((value - whole) ** 2 for value in left_out))


def main():
    arguments = parse()
    scene = with_cycles.prepare(arguments)
    with_cycles.render(scene, 1, 1)  # Builds what is built once.
    pictures, walls, runs = {}, {}, {}
    for seed in range(1, arguments.seeds + 1):
        for spp in arguments.spp:
            picture, _, wall = with_cycles.render(scene, spp, seed)
            pictures.setdefault(("cycles", spp), []).append(picture)
            walls.setdefault(("cycles", spp), []).append(wall)
            for sequence in arguments.sequence:
                picture, run = fovea(arguments, spp, seed, sequence)
                pictures.setdefault((sequence, spp), []).append(picture)
                walls.setdefault((sequence, spp), []).append(run["seconds"])
                runs[sequence] = run
    low, high = min(arguments.spp), max(arguments.spp)
    rows = []
    for name in ["cycles", *arguments.sequence]:
        cycles = name == "cycles"
        slope = (np.median(walls[name, high]) - np.median(walls[name, low])) / (high - low)
        for spp in arguments.spp:
            value, standard_error = error(pictures[name, spp])
            seconds = slope * spp if cycles else float(np.median(walls[name, spp]))
            rows.append({
                "renderer": f"Blender Cycles {bpy.app.version_string}" if cycles else f"Fovea OD, {name}",
                "spp": spp, "error": value, "standard_error": standard_error, "seconds": seconds,
                "error_times_seconds": value * seconds,
                "k_samples_per_s": spp * arguments.size[0] * arguments.size[1] / seconds / 1e3,
                "mean_path_length": None if cycles else runs[name]["mean_path_length"],
                "mean": float(np.mean(pictures[name, spp])),
            })
    common.save(arguments.out, {
        "scene": os.path.basename(arguments.scene),
        "adapter": f"{runs[arguments.sequence[0]]['adapter']} ({runs[arguments.sequence[0]]['driver']})",
        "settings": {k: v for k, v in vars(arguments).items() if k not in ("scene", "out", "fovea")},
        "rows": rows,
    })


if __name__ == "__main__":
    main()
