"""python -m hydra_viewer [STAGE] [STROKES] [LOOK]."""

import sys

from usdslf import UsdslfError, choose_pxr

choose_pxr()  # before anything imports pxr

from usdslf import require_viewer  # noqa: E402

try:
    require_viewer()
except UsdslfError as error:
    print(f"usdslf: {error}", file=sys.stderr)
    sys.exit(error.exit_code)

from hydra_viewer.ui.application import main  # noqa: E402

sys.exit(main())
