"""python -m hydra_viewer [STAGE] [STROKES] [LOOK]."""

import sys

from hydra_viewer.ui.application import main

sys.exit(main())
