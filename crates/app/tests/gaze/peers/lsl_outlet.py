"""liblsl as the source. Arguments: name, rate in Hz, seconds. Says `ready` once the stream is there."""

import sys
import time

from pylsl import StreamInfo, StreamOutlet, cf_float32, local_clock

name, rate, seconds = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
info = StreamInfo(name, "Gaze", 3, rate, cf_float32, name + "-device")
channels = info.desc().append_child("channels")
for label in ("BPOGX", "BPOGY", "BPOGV"):
    channel = channels.append_child("channel")
    channel.append_child_value("label", label)
    channel.append_child_value("unit", "normalized")
outlet = StreamOutlet(info, 1)
print("ready", flush=True)
outlet.wait_for_consumers(20)
start, step = local_clock(), 0
while step / rate < seconds:
    time.sleep(max(0.0, start + step / rate - local_clock()))
    # x counts up by thousandths, so that a sample that is missing or read wrongly shows.
    outlet.push_sample([(step % 1000) / 1000, 0.5, 1.0], local_clock())
    step += 1
print("sent", step, flush=True)
# What is still on its way when the process ends is lost.
time.sleep(0.5)
