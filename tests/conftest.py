"""Settings of the whole suite."""

import getpass
import hashlib
import os
import tempfile
from pathlib import Path

from hypothesis import settings

# numba's cache of a kernel knows the file of that kernel only, not the files that it calls into:
# after an edit there, old and new machine code would run side by side. So tests cache by content.
KERNELS = Path(__file__).parent.parent / "phasekit" / "kernels"
CONTENT = hashlib.sha256(b"".join(path.read_bytes() for path in sorted(KERNELS.glob("*.py"))))
os.environ.setdefault(
    "NUMBA_CACHE_DIR",
    f"{tempfile.gettempdir()}/phasekit-{getpass.getuser()}/{CONTENT.hexdigest()[:16]}",
)

# Compiling a kernel takes seconds in the first example. Examples repeat exactly; nothing is left
# in the working directory.
settings.register_profile("phasekit", deadline=None, derandomize=True, database=None)
settings.load_profile("phasekit")
