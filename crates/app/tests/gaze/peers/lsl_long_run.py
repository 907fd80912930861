"""120 Hz from liblsl for five minutes, the source started anew in between: `python lsl_long_run.py FOVEA [SECONDS]`.

Prints what the outlets sent and what `fovea gaze` says it received, as one JSON object.
"""

import json
import os
import pathlib
import subprocess
import sys
import tempfile

from pylsl import library_version

fovea, seconds = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 300.0
folder = pathlib.Path(__file__).parent
settings = pathlib.Path(tempfile.mkdtemp()) / "lsl_api.cfg"
settings.write_text("[lab]\nKnownPeers = {127.0.0.1}\n")
environment = dict(os.environ, LSLAPICFG=str(settings))
name = f"FoveaLong{os.getpid()}"
reader = subprocess.Popen(
    [fovea, "gaze", "--source", f"lsl:name={name}", "--seconds", str(seconds + 30), "--json"],
    stdout=subprocess.PIPE, text=True)
sent = []
for half in range(2):
    outlet = [sys.executable, str(folder / "lsl_outlet.py"), name, "120", str(seconds / 2)]
    output = subprocess.run(outlet, env=environment, capture_output=True, text=True, check=True).stdout
    sent.append(int(output.split()[-1]))
print(json.dumps({"liblsl": library_version(), "sent": sent, "received": json.loads(reader.communicate()[0])}, indent=1))
