"""The type hashes that the installed libraries of messages announce to the middleware.

As a program it prints them, as JSON, for the types that are its arguments: for environments other than the tests' own.
"""

import ctypes
import json
import sys


class TypeHash(ctypes.Structure):
    """rosidl_type_hash_t."""

    _fields_ = (("version", ctypes.c_uint8), ("value", ctypes.c_uint8 * 32))


def compiled_hash(type_name: str) -> str:
    """The hash of a type such as tf2_msgs/msg/TFMessage, as `ros2 topic info --verbose` prints it."""
    package = type_name.split("/")[0]
    library = ctypes.CDLL(f"lib{package}__rosidl_generator_c.so")
    function = getattr(library, f"{type_name.replace('/', '__')}__get_type_hash")
    function.restype = ctypes.POINTER(TypeHash)
    found = function(None).contents
    return f"RIHS{found.version:02x}_{bytes(found.value).hex()}"


if __name__ == "__main__":
    sys.stdout.write(json.dumps({name: compiled_hash(name) for name in sys.argv[1:]}))
