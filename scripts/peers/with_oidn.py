"""Denoises pictures with Intel Open Image Denoise, for the report on guided reconstruction.

    python with_oidn.py FOLDER SCENE

Needs `pyoidn` (2.5) and `numpy` from PyPI. Reads FOLDER/SCENE.COUNT.color.pfm for every COUNT with SCENE.albedo.pfm and SCENE.normal.pfm,
writes SCENE.COUNT.oidn.pfm, and prints the median seconds of one picture. CPU, HDR, highest quality, guides as noise-free.
"""

import ctypes
import glob
import os
import statistics
import sys
import time

import numpy as np
import pyoidn

CPU, FLOAT3, HIGH = 1, 3, 6


def library():
    """The C library that the package carries, with its signatures."""
    folder = os.path.dirname(pyoidn.__file__)
    lib = ctypes.CDLL(glob.glob(os.path.join(folder, "**", "libOpenImageDenoise.so.2"), recursive=True)[0])
    pointer, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
    for name, result, arguments in [
        ("oidnNewDevice", pointer, [ctypes.c_int]),
        ("oidnCommitDevice", None, [pointer]),
        ("oidnGetDeviceError", ctypes.c_int, [pointer, ctypes.POINTER(text)]),
        ("oidnNewBuffer", pointer, [pointer, size]),
        ("oidnWriteBuffer", None, [pointer, size, size, pointer]),
        ("oidnReadBuffer", None, [pointer, size, size, pointer]),
        ("oidnNewFilter", pointer, [pointer, text]),
        ("oidnSetFilterImage", None, [pointer, text, pointer, ctypes.c_int] + 5 * [size]),
        ("oidnSetFilterBool", None, [pointer, text, ctypes.c_bool]),
        ("oidnSetFilterInt", None, [pointer, text, ctypes.c_int]),
        ("oidnCommitFilter", None, [pointer]),
        ("oidnExecuteFilter", None, [pointer]),
    ]:
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    return lib


def read(path):
    """A colour PFM as rows from the bottom."""
    with open(path, "rb") as file:
        assert file.readline() == b"PF\n"
        width, height = map(int, file.readline().split())
        file.readline()
        return np.frombuffer(file.read(), "<f4").reshape(height, width, 3)


def write(path, picture):
    """The reverse."""
    with open(path, "wb") as file:
        file.write(b"PF\n%d %d\n-1.0\n" % (picture.shape[1], picture.shape[0]))
        file.write(picture.astype("<f4").tobytes())


def main():
    folder, scene = sys.argv[1:]
    lib = library()
    device = lib.oidnNewDevice(CPU)
    lib.oidnCommitDevice(device)

    def buffer(picture):
        picture = np.ascontiguousarray(picture, "f4")
        made = lib.oidnNewBuffer(device, picture.nbytes)
        lib.oidnWriteBuffer(made, 0, picture.nbytes, picture.ctypes.data)
        return made

    guides = {name: buffer(read(os.path.join(folder, f"{scene}.{name}.pfm"))) for name in ["albedo", "normal"]}
    seconds = []
    for path in sorted(glob.glob(os.path.join(glob.escape(folder), f"{glob.escape(scene)}.*.color.pfm"))):
        color = read(path)
        height, width, _ = color.shape
        output = buffer(np.zeros_like(color))
        images = {"color": buffer(color), "output": output, **guides}
        image_filter = lib.oidnNewFilter(device, b"RT")
        for name, image in images.items():
            lib.oidnSetFilterImage(image_filter, name.encode(), image, FLOAT3, width, height, 0, 0, 0)
        for flag in [b"hdr", b"cleanAux"]:
            lib.oidnSetFilterBool(image_filter, flag, True)
        lib.oidnSetFilterInt(image_filter, b"quality", HIGH)
        lib.oidnCommitFilter(image_filter)
        start = time.time()
        lib.oidnExecuteFilter(image_filter)
        seconds.append(time.time() - start)
        message = ctypes.c_char_p()
        if lib.oidnGetDeviceError(device, ctypes.byref(message)) != 0:
            sys.exit((message.value or b"").decode())
        result = np.empty_like(color)
        lib.oidnReadBuffer(output, 0, result.nbytes, result.ctypes.data)
        write(path.replace(".color.pfm", ".oidn.pfm"), result)
    print(statistics.median(seconds))


if __name__ == "__main__":
    main()
