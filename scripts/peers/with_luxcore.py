"""Time to equal foveal error in LuxCore: a panorama, and the same with its user-importance brush painted about the gaze.

    python with_luxcore.py SCENE.glb OUT.json [--camera N] [--spp 4 16] [--seeds 2] [--reference-spp 512]

Needs `pyluxcore`, `numpy` and `pillow` from PyPI. LuxCore reads no glTF: geometry, mean base colours and emission are handed over, all
surfaces matte, so its pictures are compared with its own references only. CPU path tracing, Sobol sampler, no filter, no denoiser.
"""

import io
import os
import time

import numpy as np
import pyluxcore
from PIL import Image

import common

COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
# How strongly the sampler follows the brush, 0 to 1; what is not painted gets the rest.
BRUSH_STRENGTH = 0.95


def parse():
    parser = common.parser(__doc__, seeds=2)
    parser.add_argument("--picture", help="save a panorama as PNG, to see that all is right")
    return parser.parse_args()


def accessor(gltf, binary, index):
    """Values of an accessor without sparse parts, as in the scenes that this is for."""
    found = gltf["accessors"][index]
    view = gltf["bufferViews"][found["bufferView"]]
    kind, width = np.dtype(COMPONENTS[found["componentType"]]), WIDTHS[found["type"]]
    start = view.get("byteOffset", 0) + found.get("byteOffset", 0)
    stride = view.get("byteStride", kind.itemsize * width)
    rows = np.ndarray((found["count"], width), kind, binary, start, (stride, kind.itemsize))
    return np.array(rows)


def base_colour(gltf, binary, material):
    """Mean linear base colour."""
    surface = material.get("pbrMetallicRoughness", {})
    colour = np.array(surface.get("baseColorFactor", [1, 1, 1, 1])[:3], float)
    if "baseColorTexture" in surface:
        image = gltf["images"][gltf["textures"][surface["baseColorTexture"]["index"]]["source"]]
        view = gltf["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        with Image.open(io.BytesIO(binary[start:start + view["byteLength"]])) as picture:
            texels = np.array(picture.convert("RGB").resize((32, 32)), float) / 255
        linear = np.where(texels <= 0.04045, texels / 12.92, ((texels + 0.055) / 1.055) ** 2.4)
        colour *= linear.mean((0, 1))
    return np.clip(colour, 0, 0.95)


def triplet(values):
    return " ".join(f"{value:.7g}" for value in values)


def load(arguments):
    gltf, binary = common.glb_json(arguments.scene)
    scene = pyluxcore.Scene()
    lines = []
    materials = gltf.get("materials", []) + [{}]
    for index, material in enumerate(materials):
        lines += [f"scene.materials.m{index}.type = matte",
                  f"scene.materials.m{index}.kd = {triplet(base_colour(gltf, binary, material))}"]
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
        emission = np.array(material.get("emissiveFactor", [0, 0, 0]), float) * strength
        if emission.max() > 0 and "emissiveTexture" not in material:
            lines.append(f"scene.materials.m{index}.emission = {triplet(emission)}")
    number = 0
    for node, world in common.world_nodes(gltf):
        for primitive in gltf["meshes"][node["mesh"]]["primitives"] if "mesh" in node else []:
            points = accessor(gltf, binary, primitive["attributes"]["POSITION"]) @ world[:3, :3].T + world[:3, 3]
            triangles = accessor(gltf, binary, primitive["indices"]).reshape(-1, 3)
            scene.DefineMesh(f"mesh{number}", [tuple(p) for p in points.tolist()],
                             [tuple(t) for t in triangles.tolist()], None, None, None, None)
            lines += [f"scene.objects.o{number}.shape = mesh{number}",
                      f"scene.objects.o{number}.material = m{primitive.get('material', len(materials) - 1)}"]
            number += 1
    world = common.camera(gltf, arguments.camera)
    eye = world[:3, 3]
    lines += ["scene.camera.type = environment", f"scene.camera.lookat.orig = {triplet(eye)}",
              f"scene.camera.lookat.target = {triplet(eye - world[:3, 2])}", f"scene.camera.up = {triplet(world[:3, 1])}",
              "scene.lights.sky.type = constantinfinite", f"scene.lights.sky.color = {triplet(arguments.background)}"]
    properties = pyluxcore.Properties()
    properties.SetFromString("\n".join(lines))
    scene.Parse(properties)
    return scene


def render(scene, arguments, spp, seed, brush=None, region=None):
    """Pixels, processor seconds and seconds by the clock. `brush`: importance a pixel. `region`: left, top, right, bottom."""
    width, height = arguments.size
    lines = ["renderengine.type = PATHCPU", f"renderengine.seed = {seed}", "sampler.type = SOBOL",
             f"path.pathdepth.total = {arguments.max_bounces + 1}",
             *(f"path.pathdepth.{kind} = {arguments.max_bounces + 1}" for kind in ("diffuse", "glossy", "specular")),
             "path.clamping.variance.maxvalue = 0", f"film.width = {width}", f"film.height = {height}",
             "film.filter.type = NONE", "film.hw.enable = 0", f"batch.haltspp = {spp}",
             f"sampler.sobol.adaptive.strength = {BRUSH_STRENGTH if brush is not None else 0}"]
    if brush is not None:
        lines += ["sampler.sobol.adaptive.userimportanceweight = 1", "film.outputs.0.type = USER_IMPORTANCE",
                  "film.outputs.0.filename = importance.exr"]
    if region:
        left, top, right, bottom = region
        lines.append(f"film.subregion = {left} {right - 1} {height - bottom} {height - top - 1}")
    properties = pyluxcore.Properties()
    properties.SetFromString("\n".join(lines))
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(properties, scene))
    start, cpu = time.time(), sum(os.times()[:2])
    session.Start()
    if brush is not None:
        values = np.ascontiguousarray(brush[::-1], np.float32)
        session.GetFilm().UpdateOutputFloat(pyluxcore.FilmOutputType.USER_IMPORTANCE, values)
    while not session.HasDone():
        time.sleep(0.02)
        session.UpdateStats()
    pixels = np.zeros((height, width, 3), np.float32)
    session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, pixels)
    seconds, cpu = time.time() - start, sum(os.times()[:2]) - cpu
    session.Stop()
    pixels = pixels[::-1].astype(float)
    return pixels[top:bottom, left:right] if region else pixels, cpu, seconds


def measure(judge, scene, arguments, box, brush):
    """Error by samples a pixel, and the seconds that one sample a pixel takes: the slope between fewest and most samples."""
    left, top, right, bottom = box
    errors, cpus, walls = {}, {}, {}
    for spp in arguments.spp:
        runs = []
        for seed in range(1, arguments.seeds + 1):
            pixels, cpu, wall = render(scene, arguments, spp, seed, brush)
            runs.append((judge.error(pixels[top:bottom, left:right]), cpu, wall))
        errors[spp], cpus[spp], walls[spp] = (float(np.mean(column)) for column in zip(*runs))
    low, high = min(arguments.spp), max(arguments.spp)
    slope = lambda seconds: (seconds[high] - seconds[low]) / (high - low)
    return {"error": errors, "cpu_s_a_sample": slope(cpus), "wall_s_a_sample": slope(walls), "cpu_s": cpus, "wall_s": walls}


def main():
    arguments = parse()
    pyluxcore.Init()
    pyluxcore.SetLogHandler(lambda message: None)
    scene = load(arguments)
    box = common.fovea_box(arguments.size)
    left, top, right, bottom = box
    whole = render(scene, arguments, 4, 1003)[0]
    if arguments.picture:
        Image.fromarray((np.clip(whole, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)).save(arguments.picture)
    references = [render(scene, arguments, arguments.reference_spp, seed, region=box)[0] for seed in (1001, 1002)]
    judge = common.Judge(arguments.size, box, references, float(common.luminance(whole).mean()))
    brush = np.zeros(arguments.size[::-1], np.float32)
    brush[top:bottom, left:right] = 1
    common.save(arguments.out, {
        "renderer": f"LuxCore {pyluxcore.Version()}",
        "scene": os.path.basename(arguments.scene),
        "settings": {k: v for k, v in vars(arguments).items() if k not in ("scene", "out", "picture")},
        "border_pixels": [right - left, bottom - top],
        "panorama": measure(judge, scene, arguments, box, None),
        "brush": measure(judge, scene, arguments, box, brush),
    })


if __name__ == "__main__":
    main()
