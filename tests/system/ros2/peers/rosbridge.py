"""rosbridge-server-rs as a node of this environment: PORT, FOLDER of our message packages, and a FOLDER of its own.

It looks for packages and their libraries where ament would have installed them, and its program is not executable.
"""

import os
import shutil
import sys
from pathlib import Path

import rosbridge_server_rs

port, interfaces, own = sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3])
wheels = Path(sys.prefix)
program, libraries, index = own / "server", own / "lib", own / "share" / "ament_index" / "resource_index" / "packages"
if not program.exists():
    libraries.mkdir(parents=True)
    index.mkdir(parents=True)
    for library in interfaces.glob("*/lib*.so"):
        (libraries / library.name).symlink_to(library)
        (index / library.parent.name).touch()
    (libraries / "librmw_implementation.so").symlink_to(wheels / "lib" / "librmw_fastrtps_cpp.so")  # the only one
    for library in (wheels / "lib").glob("*__rosidl_generator_py.so"):  # needs Python, and nothing here needs it
        (libraries / library.name).symlink_to(wheels / "lib" / "librcutils.so")
    shutil.copy(Path(rosbridge_server_rs.__file__).with_name("rosbridge_server_rs_jazzy"), program)
    program.chmod(0o755)
places = {
    "ROS_DISTRO": "jazzy",
    "AMENT_PREFIX_PATH": f"{own}:{wheels}",
    "LD_LIBRARY_PATH": f"{libraries}:{os.environ['LD_LIBRARY_PATH']}",
}
os.dup2(1, 2)  # who started it waits for a line of its log
os.execve(program, [str(program), "--bind", f"127.0.0.1:{port}", "--no-rosapi"], {**os.environ, **places})
