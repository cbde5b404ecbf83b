"""``python -m comparisons`` is ``pbdbench``."""

import sys

from comparisons.cli import main

sys.exit(main())
