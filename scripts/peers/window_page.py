"""docs/reports/window.md from the figures in a folder: python window_page.py docs/reports/window"""

import json
import pathlib
import sys
import textwrap

HEAD = """# The window: what was measured

Each part names the command that makes it. Times count on a quiet machine only; memory and what is shown do not depend on that.
"""


def load(folder, name):
    path = folder / f"{name}.json"
    return json.loads(path.read_text()) if path.exists() else None


def provenance(figures):
    words = f"Machine: {figures['machine']}; load {figures['load']}; adapter: {figures['adapter']}; commit {figures['commit']}."
    return textwrap.fill(words, 130)


def slider(figures):
    held = figures["frames"]
    return f"""
## A slider across a feature's edge

`scripts/window_report slider`. "Transmission" of one material of the built-in room, whose other materials are opaque here, is dragged
from 0 to 0.1 and back eight times. Without transmission and with it the room needs different kernels; the new one took
{figures['kernel_ms'] / 1e3:.1f} s to compile beside the window, which goes first. Time from one frame to the next while the button was held, with a frame asked for at
least every 10 ms:

| frames | median ms | 99 % below ms | longest ms |
|---|---|---|---|
| {held['count']} | {held['median_ms']:.1f} | {held['p99_ms']:.1f} | {held['longest_ms']:.1f} |

{provenance(figures)}
"""


def blender(figures):
    rows = "\n".join(
        f"| {number} | {change['file_bytes'] / 1e6:.2f} | {change['seconds_to_screen']:.3f} | {change['prepared_ms']:.0f} | "
        f"{change['uploaded_bytes']} | {change['device_bytes'] / 1e6:.1f} |"
        for number, change in enumerate(figures["changes"], 1)
    )
    return f"""
## The loop with Blender

`scripts/window_report blender`. Blender {figures['blender']} (`bpy`) exports a scene of four objects, then changes the base colour of one
material and exports again, while the window shows the file. From the file's last byte until the change is on screen: median
{figures['median_s']:.3f} s, longest {figures['longest_s']:.3f} s; 0.12 s of that the file rests before it is read.
{figures['cores']} cores, load {figures['load']:.1f}.

| change | file MB | s to the screen | preparing ms | bytes uploaded | MB on the device |
|---|---|---|---|---|---|
{rows}
"""


def memory(what, count, figures):
    def row(name, kind):
        first, last = kind["after_first_tenth"] / 1e6, kind["after_last_tenth"] / 1e6
        return f"| {name} | {first:.1f} | {last:.1f} | {100 * kind['growth']:+.2f} % |"

    return f"""
### {figures['count']} {what}

`scripts/window_report {what}`: {count} {figures['seconds']:.0f} s. {provenance(figures)}

| MB | after the first tenth | after the last tenth | growth |
|---|---|---|---|
{row('in use, without the device', figures['bytes_in_use'])}
{row('wgpu on the device', figures['device_bytes'])}
{row('resident', figures['resident_bytes'])}
"""


def rewrites(figures):
    return f"""
## A file rewritten at random moments

`scripts/window_report rewrites`. The window's file is written {figures['rewritten']} times in four ways (whole, by renaming, in two parts after
emptying it, in two parts over what was there) with pauses of up to 0.2 s inside and between. The window did not close; it showed
{figures['shown']:.0f} versions, all with every shape and texture, and the last one at the end. `crates/app/tests/reload.rs` writes a file as often
and checks that no version is made of two.

{provenance(figures)}
"""


def main():
    folder = pathlib.Path(sys.argv[1])
    parts = [HEAD]
    for name, part in (("slider", slider), ("blender", blender), ("rewrites", rewrites)):
        if figures := load(folder, name):
            parts.append(part(figures))
    edits, reloads = load(folder, "memory-edits"), load(folder, "memory-reloads")
    if edits or reloads:
        parts.append("""
## Memory

An engine with a document, without a window, on lavapipe, whose device memory is resident memory too. Edits: moves, colours, lights,
hiding and showing, a clearcoat that comes and goes, and undo. Reloads: colours, places, and now and then an object more or less. Means
over the twentieth of the steps after the first tenth, and over the last twentieth. In use is what was asked of the allocator;
resident are the pages of the process but those of files, while the allocator keeps little back (`crates/app/tests/memory.rs` says how
and why). Pictures are not denoised: guides come where a picture rests, by the machine's load, and bring a kernel of up to 9 MB
for each kind of geometry. 48 kernels are kept at most; filling up, they took 25 % more over 1,000 reloads on a busy machine.
""")
    if edits:
        parts.append(memory("edits", "each is on screen before the next;", edits))
    if reloads:
        parts.append(memory("reloads", "each is read, and on screen before the next;", reloads))
    sys.stdout.write("".join(parts))


if __name__ == "__main__":
    main()
