"""``python -m fretwave``."""

import sys

from .cli import main

sys.exit(main())
