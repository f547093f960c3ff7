"""Portraits that `render_people` has written, as crops: black where the person is not.

In: the folder. Out: one by one, identity, RGB, mask.
"""

from pathlib import Path

import numpy as np

from pictures import rgb


def portraits(folder):
    data = np.memmap(Path(folder) / "portraits.bin", np.uint8, "r")
    at = 0
    while at < len(data):
        identity, width, height = (int(n) for n in data[at : at + 12].view("<u4"))
        at += 12
        yuyv = data[at : at + 2 * width * height].reshape(height, width // 2, 4)
        at += yuyv.size
        mask = data[at : at + width * height].reshape(height, width)
        at += mask.size
        yield identity, rgb(yuyv), mask > 0
