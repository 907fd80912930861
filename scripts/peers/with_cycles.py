"""Time to equal foveal error in Blender Cycles: a panorama, and the same with a render border about the gaze.

    python with_cycles.py SCENE.glb OUT.json [--camera N] [--spp 4 16] [--seeds 4] [--reference-spp 512]

Needs `bpy` (5.x) and `OpenEXR` from PyPI. CPU, path tracing, no denoising, no clamping, no adaptive sampling, box filter: what is
timed is the same estimate as Fovea's. Seconds are those of the processor over all threads and by the clock, without loading.
"""

import argparse
import os
import tempfile
import time

import bpy
import numpy as np
import OpenEXR
from mathutils import Matrix

import common


def parse():
    parser = common.parser(__doc__, seeds=4)
    return parser.parse_args()


def prepare(arguments):
    """Imports the scene and sets up a panorama that looks along the camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    import addon_utils  # Known once bpy is.
    addon_utils.enable("cycles")
    bpy.ops.import_scene.gltf(filepath=os.path.abspath(arguments.scene), export_import_convert_lighting_mode="COMPAT")
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    gltf, _ = common.glb_json(arguments.scene)
    world = common.camera(gltf, arguments.camera)
    data = bpy.data.cameras.new("panorama")
    data.type = "PANO"
    data.panorama_type = "EQUIRECTANGULAR"
    data.clip_start, data.clip_end = 1e-4, 1e6
    camera = bpy.data.objects.new("panorama", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    z_up_from_y_up = Matrix(((1, 0, 0, 0), (0, 0, -1, 0), (0, 1, 0, 0), (0, 0, 0, 1)))
    camera.matrix_world = z_up_from_y_up @ Matrix(world.tolist())

    render, cycles = scene.render, scene.cycles
    render.resolution_x, render.resolution_y = arguments.size
    render.resolution_percentage = 100
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.use_compositing = render.use_sequencer = False
    render.use_file_extension = False
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = arguments.max_bounces
    cycles.transparent_max_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0
    cycles.pixel_filter_type = "BOX"
    for light in bpy.data.lights:
        if light.type == "SUN":
            light.angle = 0
    world = bpy.data.worlds.new("background")
    scene.world = world
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = [*arguments.background, 1]
    return scene


def render(scene, spp, seed, border=None):
    """Pixels, processor seconds and seconds by the clock of one render; `border` in pixels: left, top, right, bottom."""
    width, height = scene.render.resolution_x, scene.render.resolution_y
    scene.render.use_border = scene.render.use_crop_to_border = border is not None
    if border:
        left, top, right, bottom = border
        scene.render.border_min_x, scene.render.border_max_x = left / width, right / width
        scene.render.border_min_y, scene.render.border_max_y = 1 - bottom / height, 1 - top / height
    scene.cycles.samples, scene.cycles.seed = spp, seed
    with tempfile.TemporaryDirectory() as folder:
        path = scene.render.filepath = os.path.join(folder, "picture.exr")
        start, cpu = time.time(), sum(os.times()[:2])
        bpy.ops.render.render(write_still=True)
        seconds, cpu = time.time() - start, sum(os.times()[:2]) - cpu
        with OpenEXR.File(path) as file:
            channels = file.channels()
            name = next(name for name in ("RGB", "RGBA") if name in channels)
            pixels = np.array(channels[name].pixels[..., :3], float)
    return pixels, cpu, seconds


def measure(judge, scene, arguments, box, border):
    """Error by samples a pixel, and the seconds that one sample a pixel takes: the slope between fewest and most samples."""
    left, top, right, bottom = box
    errors, cpus, walls = {}, {}, {}
    for spp in arguments.spp:
        runs = []
        for seed in range(1, arguments.seeds + 1):
            pixels, cpu, wall = render(scene, spp, seed, box if border else None)
            inside = pixels if border else pixels[top:bottom, left:right]
            runs.append((judge.error(inside), cpu, wall))
        errors[spp], cpus[spp], walls[spp] = (float(np.mean(column)) for column in zip(*runs))
    low, high = min(arguments.spp), max(arguments.spp)
    slope = lambda seconds: (seconds[high] - seconds[low]) / (high - low)
    return {"error": errors, "cpu_s_a_sample": slope(cpus), "wall_s_a_sample": slope(walls), "cpu_s": cpus, "wall_s": walls}


def main():
    arguments = parse()
    scene = prepare(arguments)
    box = common.fovea_box(arguments.size)
    left, top, right, bottom = box
    references = [render(scene, arguments.reference_spp, seed, box)[0] for seed in (1001, 1002)]
    whole = render(scene, 4, 1003)[0]
    judge = common.Judge(arguments.size, box, references, float(common.luminance(whole).mean()))
    more = argparse.Namespace(**{**vars(arguments), "spp": [16 * spp for spp in arguments.spp]})
    common.save(arguments.out, {
        "renderer": f"Blender Cycles {bpy.app.version_string}",
        "scene": os.path.basename(arguments.scene),
        "settings": {k: v for k, v in vars(arguments).items() if k not in ("scene", "out")},
        "border_pixels": [right - left, bottom - top],
        "panorama": measure(judge, scene, arguments, box, False),
        "border": measure(judge, scene, more, box, True),
    })


if __name__ == "__main__":
    main()
