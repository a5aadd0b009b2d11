"""Write a map (map.yaml and its image) and a mesh (ground.ply), both 8 m wide and empty, into the folder given."""

import sys
from pathlib import Path

folder = Path(sys.argv[1])
SIDE = 41  # vertices

folder.joinpath("map.pgm").write_bytes(b"P5\n160 160\n255\n" + bytes([254]) * 160 * 160)
folder.joinpath("map.yaml").write_text("{image: map.pgm, resolution: 0.05, origin: [0, 0, 0]}\n")

vertices = [f"{0.2 * x:g} {0.2 * y:g} 0" for y in range(SIDE) for x in range(SIDE)]
squares = [y * SIDE + x for y in range(SIDE - 1) for x in range(SIDE - 1)]
faces = [
    f"3 {a} {b} {c}"
    for one in squares
    for a, b, c in ((one, one + 1, one + SIDE), (one + 1, one + SIDE + 1, one + SIDE))
]
header = f"""ply
format ascii 1.0
element vertex {len(vertices)}
property float x
property float y
property float z
element face {len(faces)}
property list uchar int vertex_indices
end_header
"""
folder.joinpath("ground.ply").write_text(header + "\n".join([*vertices, *faces]) + "\n")
