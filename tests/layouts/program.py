"""Registers the layout "nearest" and runs commands of diffract-bake: python -m tests.layouts.program FOLDER.

The classes of configs and manifests are made once, when they are imported, so this takes a process of its own.
Commands are read as JSON from stdin, and may hold patterns of files; [exit code, stdout, stderr] of each are printed.
"""

import json
import sys
from pathlib import Path

from pipeline import layouts
from tests.layouts.nearest.table import NearestLayout

layouts.LAYOUTS["nearest"] = layouts.Registered(
    NearestLayout, stages="tests.layouts.nearest.stages", bundle="tests.layouts.nearest.bundle"
)

if __name__ == "__main__":
    from tests.cli.tool import Tool

    folder = Path(sys.argv[1])
    tool = Tool(folder, folder / "store")
    results = []
    for command in json.load(sys.stdin):
        # the name of a bundle is known when it is made
        named = [str(next(folder.glob(word))) if "*" in word else word for word in command]
        done = tool(*named)
        results.append([done.code, done.stdout, done.stderr])
    json.dump(results, sys.stdout)
