"""A reader of Pupil Capture by libzmq and msgpack. Arguments: Pupil Remote's port, points. Prints a JSON list of them."""

import json
import sys

import msgpack
import zmq

context = zmq.Context()
remote = context.socket(zmq.REQ)
remote.connect("tcp://127.0.0.1:" + sys.argv[1])
remote.send_string("SUB_PORT")
reader = context.socket(zmq.SUB)
reader.connect("tcp://127.0.0.1:" + remote.recv_string())
reader.setsockopt_string(zmq.SUBSCRIBE, "surfaces.screen")
reader.setsockopt(zmq.RCVTIMEO, 10000)
points = []
while len(points) < int(sys.argv[2]):
    topic, payload = reader.recv_multipart()
    points += [gaze["norm_pos"] for gaze in msgpack.unpackb(payload)["gaze_on_surfaces"]]
print(json.dumps(points))
