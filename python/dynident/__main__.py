"""`python -m dynident`."""

import sys

from ._command import main

sys.exit(main())
