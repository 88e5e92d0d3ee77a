"""Runs the tests of this folder; exit status 77 (skipped) where torch, numpy or OpenCV are not installed."""
import importlib.util
import os
import sys
import unittest

SKIPPED = 77

if __name__ == "__main__":
    missing = [name for name in ("numpy", "cv2", "torch") if importlib.util.find_spec(name) is None]
    if missing:
        print(f"skipped: {sys.executable} has no {', '.join(missing)}")
        sys.exit(SKIPPED)
    here = os.path.dirname(os.path.abspath(__file__))
    suite = unittest.defaultTestLoader.discover(here, pattern="test_*.py")
    sys.exit(0 if unittest.TextTestRunner(verbosity=2).run(suite).wasSuccessful() else 1)
