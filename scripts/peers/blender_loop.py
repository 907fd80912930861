"""The loop with Blender, measured: export, change one material, export again, with the window beside it.

    python blender_loop.py FOVEA OUT.json [--changes 8]

Needs `bpy` (5.x) from PyPI, Xvfb and xdotool; scripts/blender_loop sets all of that up. The time of a change goes from the last
write to the file, as the file system stamps it, to the beginning of the window's frame after the one that first painted the new
version: by then it is on screen.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

import bpy

# Seconds from one change to the next, and from the first picture to the first change.
PAUSE, START = 4.0, 10.0


def scene():
    """A few objects, a lamp and a camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)

    def material(name, color, roughness, metallic=0.0):
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        shader = made.node_tree.nodes["Principled BSDF"]
        shader.inputs["Base Color"].default_value = (*color, 1.0)
        shader.inputs["Roughness"].default_value = roughness
        shader.inputs["Metallic"].default_value = metallic
        return made

    def last(made):
        bpy.context.object.data.materials.append(made)
        return bpy.context.object

    bpy.ops.mesh.primitive_plane_add(size=12)
    last(material("floor", (0.5, 0.5, 0.5), 0.8))
    bpy.ops.mesh.primitive_monkey_add(size=2, location=(0, 0, 1))
    subject = last(material("subject", (0.8, 0.1, 0.1), 0.4))
    subject.modifiers.new("smooth", "SUBSURF").levels = 2
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.7, location=(2.2, 0.5, 0.7), segments=64, ring_count=32)
    last(material("metal", (0.9, 0.8, 0.5), 0.1, 1.0))
    bpy.ops.mesh.primitive_cube_add(size=1.2, location=(-2.2, 0.4, 0.6))
    last(material("box", (0.1, 0.3, 0.7), 0.6))
    bpy.ops.object.light_add(type="POINT", location=(3, -4, 5))
    bpy.context.object.data.energy = 1500
    bpy.ops.object.camera_add(location=(0, -8, 3), rotation=(1.25, 0, 0))
    bpy.context.scene.camera = bpy.context.object


def export(path):
    """Writes the file; when its last byte was written, seconds since 1970."""
    bpy.ops.export_scene.gltf(
        filepath=path, export_format="GLB", export_apply=True, export_cameras=True, export_lights=True
    )
    return os.stat(path).st_mtime


def display():
    """An X server without a screen, and its name."""
    read, write = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x720x24", "-nolisten", "tcp", "-noreset"],
        pass_fds=[write], stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as pipe:
        return server, ":" + pipe.readline().strip()


def wait_for_title(environment, title, window):
    """Until the scene is open."""
    command = ["xdotool", "search", "--name", title]
    while not subprocess.run(command, env=environment, capture_output=True).stdout.strip():
        if window.poll() is not None:
            sys.exit("the window has closed")
        time.sleep(0.1)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("fovea")
    parser.add_argument("out")
    parser.add_argument("--changes", type=int, default=8)
    arguments = parser.parse_args()
    server, name = display()
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "DISPLAY": name, "XDG_CONFIG_HOME": folder}
        environment.pop("WAYLAND_DISPLAY", None)
        path, picture = os.path.join(folder, "loop.glb"), os.path.join(folder, "window.png")
        scene()
        export(path)
        seconds = START + PAUSE * (arguments.changes + 1)
        window = subprocess.Popen(
            [arguments.fovea, path, "--screenshot-after", str(seconds), "--screenshot", picture],
            env=environment, stdout=subprocess.PIPE,
        )
        wait_for_title(environment, "loop.glb", window)
        time.sleep(START)
        shader = bpy.data.materials["subject"].node_tree.nodes["Principled BSDF"]
        written = []
        for number in range(arguments.changes):
            share = (number + 1) / arguments.changes
            shader.inputs["Base Color"].default_value = (0.8 * (1 - share), 0.1, 0.8 * share, 1.0)
            written.append((export(path), os.path.getsize(path)))
            time.sleep(PAUSE)
        figures = json.loads(window.communicate()[0])
    server.terminate()
    changes = []
    for (at, size), until in zip(written, [at for at, _ in written[1:]] + [float("inf")]):
        shown = [v for v in figures["versions"] if at < v["on_screen_unix_s"] < until]
        if not shown:
            sys.exit("a change was not shown")
        changes.append({
            "file_bytes": size,
            "seconds_to_screen": shown[0]["on_screen_unix_s"] - at,
            "uploaded_bytes": shown[0]["uploaded_bytes"],
            "device_bytes": shown[0]["device_bytes"],
            "prepared_ms": shown[0]["prepared_ms"],
        })
    took = [change["seconds_to_screen"] for change in changes]
    report = {
        "blender": bpy.app.version_string,
        "cores": os.cpu_count(),
        "load": os.getloadavg()[0],
        "median_s": statistics.median(took),
        "longest_s": max(took),
        "changes": changes,
    }
    with open(arguments.out, "w") as out:
        json.dump(report, out, indent=1)
        out.write("\n")


if __name__ == "__main__":
    main()
