"""python -m hydra_viewer [STAGE] [STROKES] [LOOK]."""

import sys

from usdslf import choose_pxr

choose_pxr()  # before anything imports pxr

from hydra_viewer.ui.application import main  # noqa: E402

sys.exit(main())
