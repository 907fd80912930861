"""liblsl as the reader. Arguments: name, samples. Prints a JSON object about what came."""

import json
import sys

from pylsl import StreamInlet, local_clock, resolve_byprop

found = resolve_byprop("name", sys.argv[1], 1, 10)
inlet = StreamInlet(found[0])
inlet.open_stream(10)
labels = inlet.info(10).get_channel_labels()
ahead = -inlet.time_correction(10)
values, ages = [], []
while len(values) < int(sys.argv[2]):
    sample, stamp = inlet.pull_sample(10)
    if sample is None:
        break
    values.append(sample)
    ages.append(local_clock() - (stamp - ahead))
print(json.dumps({"labels": labels, "values": values, "median_age": sorted(ages)[len(ages) // 2]}))
