"""Makes the writers of point clouds importable, and clouds of known ground."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
