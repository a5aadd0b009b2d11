"""Makes the floor on which obstacles are seen importable."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
