"""Picture a recording in the viewer's web page: notebooks/pictures/viewer.png.

From the root of a clone, with Chromium::

    swgjoint demo && python tests/benchmarks/viewer_picture.py swgjoint-demo/run.rrd
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "notebooks" / "pictures" / "viewer.png"


def main() -> None:
    """Serve the recording, open the page, wait until it is drawn, and picture it."""
    sys.path.insert(0, str(ROOT / "tests" / "shared"))
    from browser import SOFTWARE_WEBGL, Browser

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", help="recording to show")
    parser.add_argument("--out", default=str(PICTURE), help="PNG file to write")
    parser.add_argument("--wait", type=float, default=60.0, help="time to draw [s]")
    args = parser.parse_args()
    view = [sys.executable, "-m", "swgjoint", "view", "--web", "--json"]
    answer = subprocess.run([*view, args.recording], stdout=subprocess.PIPE, check=True)
    viewer = json.loads(answer.stdout)
    browser = Browser((1400, 760), SOFTWARE_WEBGL)
    try:
        page = browser.open(viewer["url"])
        time.sleep(args.wait)
        page.picture(args.out)
    finally:
        browser.close()
        os.kill(viewer["pid"], signal.SIGTERM)


if __name__ == "__main__":
    main()
