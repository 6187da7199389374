"""A relay without observation and reports: `untold.py FILE`. The difference to a relay is what saying why costs."""

import sys
from collections import deque
from typing import Any

from syncrelay.dataflow import flow

# Before the compiled flow takes it over.
flow.RECENT = 0  # type: ignore[misc]  # this file takes away what is there

from syncrelay.cli import main  # noqa: E402
from syncrelay.relay.monitor import Monitor  # noqa: E402

_NOTHING = deque[Any](maxlen=0)

flow.Watched.none_of = lambda n_inputs: flow.Watched((_NOTHING,) * n_inputs, _NOTHING)  # type: ignore[method-assign]  # as above
Monitor.evaluate = lambda _: None  # type: ignore[assignment,method-assign]  # as above
Monitor.evaluate_in_turn = lambda _: None  # type: ignore[assignment,method-assign]  # as above
sys.exit(main(["--config", sys.argv[1]]))
