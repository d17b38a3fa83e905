"""``python -m bt_tasksim.cli``: the command ``bt-tasksim`` without its script."""

import sys

from bt_tasksim.cli.start import main

sys.exit(main())
