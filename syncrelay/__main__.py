"""`python -m syncrelay`."""

import sys

from syncrelay.cli import main

sys.exit(main())
