"""``python -m fretwave``."""

import sys

from .commands.main import main

sys.exit(main())
