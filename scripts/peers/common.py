"""What the comparisons with other renderers have in common: the study's error measure, cameras of glTF files, results.

Errors are those of `fovea study`: mean of (x - r1)(x - r2) over two references of the same renderer, each pixel's divided by its squared
reference luminance (mean of 3 x 3 pixels) plus the square of a tenth of the film's mean luminance, weighted by solid angle, over the
disc of 5.79 degrees about the gaze.
"""

import argparse
import json
import math
import struct

import numpy as np

FOVEA_DEG = 5.79


def parser(description, seeds):
    """The arguments that every comparison has."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("scene")
    parser.add_argument("out")
    parser.add_argument("--camera", type=int, default=0)
    parser.add_argument("--spp", type=int, nargs="+", default=[4, 16])
    parser.add_argument("--seeds", type=int, default=seeds)
    parser.add_argument("--reference-spp", type=int, default=512)
    parser.add_argument("--max-bounces", type=int, default=3)
    parser.add_argument("--background", type=float, nargs=3, default=[1, 1, 1])
    parser.add_argument("--size", type=int, nargs=2, default=[512, 256])
    return parser


def glb_json(path):
    """The JSON part of a .glb file, and its binary part."""
    with open(path, "rb") as file:
        data = file.read()
    length = struct.unpack_from("<I", data, 12)[0]
    return json.loads(data[20:20 + length]), data[20 + length + 8:]


def node_matrix(node):
    """Parent from node, 4x4."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0, 0, 0, 1])
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", [1, 1, 1]))
    matrix[:3, 3] = node.get("translation", [0, 0, 0])
    return matrix


def world_nodes(gltf):
    """Every node of the file's scene with its world matrix, depth first."""
    def below(index, parent):
        node = gltf["nodes"][index]
        world = parent @ node_matrix(node)
        yield node, world
        for child in node.get("children", []):
            yield from below(child, world)

    for root in gltf["scenes"][gltf.get("scene", 0)]["nodes"]:
        yield from below(root, np.eye(4))


def camera(gltf, index):
    """World matrix of the camera that is `index`-th in file order."""
    return [world for node, world in world_nodes(gltf) if "camera" in node][index]


def luminance(rgb):
    return rgb @ np.array([0.2126, 0.7152, 0.0722])


class Judge:
    """Foveal error of panoramas against two references that are known about the gaze."""

    def __init__(self, size, box, references, mean_luminance, yaw_deg=0.0, pitch_deg=0.0):
        """`box`: left, top, right, bottom of the references in the panorama's pixels."""
        width, height = size
        left, top, right, bottom = box
        self.references = references
        y, x = np.mgrid[top:bottom, left:right] + 0.5
        longitude, latitude = (x / width - 0.5) * 2 * math.pi, (0.5 - y / height) * math.pi
        yaw, pitch = math.radians(yaw_deg), math.radians(pitch_deg)
        cosine = np.sin(latitude) * math.sin(pitch) + np.cos(latitude) * math.cos(pitch) * np.cos(longitude - yaw)
        inside = np.degrees(np.arccos(np.clip(cosine, -1, 1))) <= FOVEA_DEG
        self.weight = np.where(inside, np.cos(latitude), 0.0)
        both = luminance(0.5 * (references[0] + references[1]))
        padded = np.pad(both, 1, mode="edge")
        rows, columns = both.shape
        smooth = sum(padded[j:j + rows, i:i + columns] for j in range(3) for i in range(3)) / 9
        self.divisor = smooth ** 2 + (0.1 * mean_luminance) ** 2

    def error(self, picture):
        """Of the part of a panorama in the box."""
        product = ((picture - self.references[0]) * (picture - self.references[1])).mean(-1)
        return float((self.weight * product / self.divisor).sum() / self.weight.sum())


def fovea_box(size, yaw_deg=0.0, pitch_deg=0.0, half_deg=8.0):
    """The pixels within `half_deg` of the gaze on both axes; the gaze is away from seam and poles."""
    width, height = size
    across = half_deg / math.cos(math.radians(pitch_deg))
    left, right = (0.5 + (yaw_deg - across) / 360) * width, (0.5 + (yaw_deg + across) / 360) * width
    top, bottom = (0.5 - (pitch_deg + half_deg) / 180) * height, (0.5 - (pitch_deg - half_deg) / 180) * height
    return math.floor(left), math.floor(top), math.ceil(right), math.ceil(bottom)


def save(path, results):
    with open(path, "w") as file:
        json.dump(results, file, indent=1)
        file.write("\n")
    print(json.dumps(results, indent=1))
