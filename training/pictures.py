"""Pictures that `render_people` has written: colours, masks and the truth about everybody.

In: its folder. Out: RGB as the camera's driver converts it, label maps, rows of `people.csv`.
"""

import csv
from collections import namedtuple
from pathlib import Path

import numpy as np

WIDTH, HEIGHT = 640, 360

# A person in a frame; `camera` is unique over all buildings, `label` is the person's number in that
# frame's mask.
Seen = namedtuple("Seen", "frame camera label id box visible whole distance_m bearing_deg")


def rgb(yuyv):
    """RGB of [..., rows, columns / 2, 4] YUYV: the driver's arithmetic (BT.601, studio range)."""
    y = 298 * (yuyv[..., [0, 2]].astype(np.int32) - 16) + 128
    u = yuyv[..., 1].astype(np.int32)[..., None] - 128
    v = yuyv[..., 3].astype(np.int32)[..., None] - 128
    channels = np.stack([y + 409 * v, y - 100 * u - 208 * v, y + 516 * u], -1) >> 8
    rows, pairs = channels.shape[-4:-2]
    return np.clip(channels, 0, 255).astype(np.uint8).reshape(*yuyv.shape[:-3], rows, 2 * pairs, 3)


class Pictures:
    def __init__(self, folder):
        folder = Path(folder)
        self.yuyv = np.memmap(folder / "color.yuyv", np.uint8, "r").reshape(-1, HEIGHT, WIDTH // 2, 4)
        self.masks = np.memmap(folder / "masks.u8", np.uint8, "r").reshape(-1, HEIGHT, WIDTH)
        with open(folder / "people.csv") as file:
            self.people = [
                Seen(
                    int(row["frame"]),
                    int(row["camera"]),
                    int(row["person"]),
                    int(row["id"]),
                    tuple(int(row[side]) for side in ("left", "top", "right", "bottom")),
                    int(row["visible"]),
                    int(row["whole"]),
                    float(row["distance_m"]),
                    float(row["bearing_deg"]),
                )
                for row in csv.DictReader(file)
            ]

    def __len__(self):
        return len(self.yuyv)

    def image(self, frame):
        return rgb(self.yuyv[frame])
