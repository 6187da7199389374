"""Leaving the ROS graph, although Fast DDS may hang forever.

It deadlocks if another node says farewell just as it removes its own participant, as when a whole robot ends at once:
the listener's lock is held while its last call waits for it (https://github.com/eProsima/Fast-DDS/issues/6513).
"""

import logging
import os
import threading
from ctypes import CDLL, c_void_p, py_object, pythonapi
from typing import Any, Final

from syncrelay.fastdds_files import held_by, remove_unused

# Launch sends SIGTERM 5 s after SIGINT, and SIGKILL 5 s later; what usually takes 10 ms needs more on a busy machine.
_PATIENCE_S: Final = 3.0
_NAME: Final = "syncrelay-leaving"
_LOG: Final = logging.getLogger("syncrelay")


def leave(node: Any, context: Any) -> None:
    """Destroy a node, if there is one, and shut its context down.

    Where DDS takes too long for that, say so and remove what it would leave in shared memory; a thread goes on with it.
    """
    if node is None:
        context.try_shutdown()
        return
    held = held_by(os.getpid())
    # While the handle is in use, rclpy does not destroy the node: it would hold the GIL meanwhile, and block us too.
    handle = node.handle
    handle.__enter__()
    pythonapi.Py_IncRef(py_object(handle))
    address = handle.pointer
    node.destroy_node()
    leaving = threading.Thread(target=_take_from_rcl, args=(address,), daemon=True, name=_NAME)
    leaving.start()
    leaving.join(_PATIENCE_S)
    if leaving.is_alive():
        _LOG.warning("DDS did not let this node go within %g s: ended without waiting any longer", _PATIENCE_S)
        remove_unused(held)
    else:
        context.try_shutdown()


def is_leaving() -> bool:
    """Whether DDS still holds a node, so that this process can only be ended by `os._exit`."""
    return any(thread.name == _NAME for thread in threading.enumerate())


def _take_from_rcl(address: int) -> None:
    rcl = CDLL("librcl.so")
    for function in (rcl.rcl_logging_rosout_fini_publisher_for_node, rcl.rcl_node_fini):
        function.argtypes = [c_void_p]
        function(address)
