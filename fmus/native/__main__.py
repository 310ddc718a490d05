"""Makes the native FMUs that come with a wheel, where ziglang is installed: `python -m trihedron.fmus.native FOLDER`.

The folder gets fmi2/ and fmi3/ with every component for all platforms, and the manifest.
"""

import json
import sys
from pathlib import Path

from .. import build, component_names
from .compile import MANIFEST, PLATFORMS, all_flags, zig_version

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    for fmi in (2, 3):
        for name in component_names():
            print(build(name, folder / f"fmi{fmi}", flavour="native", fmi=fmi, platform="all"))
    content = {"compiler": f"zig {zig_version()}", "flags": all_flags(), "platforms": list(PLATFORMS)}
    (folder / MANIFEST).write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8", newline="\n")
