"""Pupil Capture's network interface by libzmq and msgpack. Argument: seconds. Says `ready PORT` with Pupil Remote's port."""

import sys
import threading
import time

import msgpack
import zmq

context = zmq.Context()
publisher = context.socket(zmq.PUB)
port = publisher.bind_to_random_port("tcp://127.0.0.1")
remote = context.socket(zmq.REP)
remote_port = remote.bind_to_random_port("tcp://127.0.0.1")


def answer():
    while True:
        question = remote.recv_string()
        remote.send_string({"SUB_PORT": str(port), "t": repr(time.monotonic())}.get(question, "Unknown command."))


threading.Thread(target=answer, daemon=True).start()
print("ready", remote_port, flush=True)
start, step = time.monotonic(), 0
while time.monotonic() - start < float(sys.argv[1]):
    # By the schedule: a message that is late must not have points of the time of the one before.
    now = start + step * 0.032
    points = []
    for part in range(4):
        points.append({
            "topic": "gaze.3d.01._on_surface",
            "norm_pos": (0.25, 0.75),
            "confidence": 0.98 if part < 3 else 0.2,
            "on_surf": True,
            "base_data": ("gaze.3d.01.", now),
            "timestamp": now - 0.024 + 0.008 * part,
        })
    for name in ("screen", "wall"):
        message = {"topic": "surfaces." + name, "name": name, "surf_to_img_trans": [[1.0, 0.0, 0.0]] * 3,
                   "gaze_on_surfaces": points, "fixations_on_surfaces": [], "timestamp": now}
        publisher.send_multipart([message["topic"].encode(), msgpack.packb(message)])
    step += 1
    time.sleep(max(0.0, start + step * 0.032 - time.monotonic()))
