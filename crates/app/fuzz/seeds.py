#!/usr/bin/env python3
"""Writes one valid recording of each protocol into corpus/: where fuzzing starts. Run in this folder; standard library only."""

import pathlib
import struct


def put(target, name, data):
    folder = pathlib.Path("corpus") / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def text(value):
    return bytes([0xA0 | len(value)]) + value.encode()


def number(value):
    return b"\xcb" + struct.pack(">d", value)


REC = '<REC CNT="{n}" TIME="{t:.5f}" BPOGX="{x:.5f}" BPOGY="0.41000" BPOGV="{v}" BKID="0" />\r\n'
put("opengaze", "seed-session", '<ACK ID="ENABLE_SEND_DATA" STATE="1" />\r\n'
    + "".join(REC.format(n=n, t=n / 60, x=0.4 + n / 100, v=int(n != 3)) for n in range(6)))
put("opengaze", "seed-calibration", '<CAL ID="CALIB_RESULT" CALX1="0.5" CALY1="0.5" LX1="0.49" LV1="1" />'
    '<ACK ID="CALIBRATE_RESULT_SUMMARY" AVE_ERROR="19.43" VALID_POINTS="5" /><NACK ID="X" />'
    '<ACK ID="SCREEN_SIZE" X="0" Y="0" WIDTH="1920" HEIGHT="1080" />')

INFO = ('<?xml version="1.0"?>\n<info>\n<name>GP3</name><type>Gaze</type><channel_count>3</channel_count>'
        "<channel_format>{format}</channel_format><source_id>s1</source_id><nominal_srate>60.00</nominal_srate>"
        "<version>1.10</version><created_at>1.5</created_at><uid>5f0c</uid><session_id>default</session_id>"
        "<hostname>pc</hostname><v4address /><v4data_port>16572</v4data_port><v4service_port>16573</v4service_port>"
        "<v6address /><v6data_port>0</v6data_port><desc>{desc}</desc></info>\n")
DESC = ("<channels><channel><label>BPOGX</label><unit>normalized</unit></channel>"
        "<channel><label>BPOGY</label></channel><channel/></channels>")
put("lsl_info", "seed-short", "4711\r\n" + INFO.format(format="float32", desc=""))
put("lsl_info", "seed-full", INFO.format(format="double64", desc=DESC))
put("lsl_info", "seed-int", INFO.format(format="int16", desc=DESC))
put("lsl_info", "seed-clock", " 3 1.000 6.010 6.012\r\n")

HEAD = "LSL/110 200 OK\r\nUID: 5f0c\r\nByte-Order: {order}\r\nSuppress-Subnormals: 0\r\nData-Protocol-Version: 110\r\n\r\n"


def sample(order, kind, stamp, values):
    head = b"\x01" if stamp is None else b"\x02" + struct.pack(order + "d", stamp)
    return head + struct.pack(f"{order}{len(values)}{kind}", *values)


for index, (kind, order, name) in enumerate([("f", "<", "1234"), ("d", ">", "4321"), ("b", "<", "1234"),
                                             ("h", ">", "4321"), ("i", "<", "1234"), ("q", "<", "1234")]):
    # The first byte chooses format and number of channels: 2.
    body = b"".join(sample(order, kind, stamp, [v, v + 1])
                    for stamp, v in [(123456.789, 4), (123456.789, 2), (10.0, 0), (None, 1), (10.1, 0)])
    put("lsl_feed", f"seed-{kind}", bytes([12 + index]) + HEAD.format(order=name).encode() + body)
put("lsl_feed", "seed-refused", bytes([12]) + b"LSL/110 404 Not found\r\n")

GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x01" + b"NULL".ljust(20, b"\0") + bytes(32)
READY = b"\x05READY\x0bSocket-Type\0\0\0\x03PUB\x08Identity\0\0\0\0"
OPENED = GREETING + bytes([4, len(READY)]) + READY


def point(time, x, y, extra=b""):
    return (bytes([0x85]) + text("topic") + text("gaze.2d.0._on_surface") + text("norm_pos") + b"\x92" + number(x)
            + number(y) + text("confidence") + number(0.93) + text("on_surf") + b"\xc3" + text("timestamp") + number(time))


MESSAGE = (b"\x85" + text("topic") + text("surfaces.screen") + text("name") + text("screen")
           + text("gaze_on_surfaces") + b"\x92" + point(1.0, 0.2, 0.7) + point(1.008, 0.21, 0.69)
           + text("surf_to_img_trans") + b"\x93" + b"\x93" + number(1) * 3 + b"\xdc\0\1\xca\0\0\0\0" + b"\xc0"
           + text("timestamp") + number(1.0))
TYPES = (b"\x8d\xd9\1a\xcc\1\xda\0\1b\xcd\0\1\xdb\0\0\0\1c\xce\0\0\0\1\xc4\1d\xcf" + bytes(8) + b"\xc5\0\1e\xd0\1"
         b"\xc6\0\0\0\1f\xd1\0\1\1\xd2\0\0\0\1\2\xd3" + bytes(8) + b"\3\xc7\1\1\0\4\xc8\0\1\1\0\5\xc9\0\0\0\1\1\0"
         b"\6\xd8" + bytes(17) + b"\7\xdd\0\0\0\1\xde\0\1\1\xdf\0\0\0\1\2\xc2")
put("pupil", "seed-surface", MESSAGE)
put("pupil", "seed-types", TYPES)
put("zmtp", "seed-pub", OPENED + bytes([1, 15]) + b"surfaces.screen" + b"\x02" + struct.pack(">Q", len(MESSAGE)) + MESSAGE)
put("zmtp", "seed-rep", OPENED + bytes([1, 0, 0, 5]) + b"50021" + bytes([4, 7]) + b"\x04PING\0\0")
put("zmtp", "seed-error", GREETING + bytes([4, 10]) + b"\x05ERROR\x03no!")

put("trace", "seed-screen", "# gaze-trace v1; source=gazepoint; space=screen01; screen_mm=531x299; distance_mm=650; rate_hz=120\n"
    "t_s,x,y,valid,conf\n0.000000,0.500000,0.250000,1,0.900\n0.008333,0.510000,0.250000,0,0.000\n# note\n\n0.02,nan,0,0,0\n")
put("trace", "seed-view", "# gaze-trace v1; space=view_deg\nt_s,yaw_deg,pitch_deg,valid\n0,-5,2.5,1\n0.01,-5.5,2.5,1\n")
put("trace", "seed-late", "# gaze-trace v1; space=view_deg\nt_s,yaw_deg,pitch_deg,valid\n0,-5,2.5,1\n1e19,-5.5,2.5,1\n")
put("trace", "seed-dense", "# gaze-trace v1; space=view_deg\nt_s,yaw_deg,pitch_deg,valid\n0,-5,2.5,1\n1e-10,-5.5,2.5,1\n")

block = bytearray(128)
block[1:7] = b"\xff" * 6
block[21:23] = bytes([53, 30])
block[54:69] = bytes([2, 0x3A, 0x80, 0, 0x70, 0x38, 0, 0x40, 0, 0, 0, 0, 0x13, 0x2B, 0x21])
block[127] = -sum(block) & 255
put("edid", "seed-monitor", bytes(block))
block[66:69] = bytes([16, 9, 0])
block[127] = 0
block[127] = -sum(block) & 255
put("edid", "seed-aspect", bytes(block))
