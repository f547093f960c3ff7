"""librealsense's alignment of depth to colour, on the images that Hachi's `frame_speed` uses.

    .peers/bin/pip install pyrealsense2 numpy      # needs the system's libusb-1.0
    .peers/bin/python benches/align_peer.py
"""

import time

import numpy as np
import pyrealsense2 as rs

ROUNDS = 101
LENS = [-0.05698, 0.06602, 0.00021, 0.00069, -0.02085]
DEPTH = (848, 480, 424.23, 424.23, 423.43, 236.05)
COLORS = [
    (848, 480, 421.65, 421.10, 429.68, 239.22),
    (1280, 720, 636.45, 635.62, 648.58, 358.82),
]


def intrinsics(numbers, model, coefficients):
    optics = rs.intrinsics()
    optics.width, optics.height, optics.fx, optics.fy, optics.ppx, optics.ppy = numbers
    optics.model, optics.coeffs = model, coefficients
    return optics


def stream(kind, uid, bytes_per_pixel, pixels, optics):
    video = rs.video_stream()
    video.type, video.index, video.uid, video.fps = kind, 0, uid, 30
    video.width, video.height = optics.width, optics.height
    video.bpp, video.fmt, video.intrinsics = bytes_per_pixel, pixels, optics
    return video


def pair(color_numbers):
    """One depth and one colour image through a software device, as a frame set."""
    depth_optics = intrinsics(DEPTH, rs.distortion.brown_conrady, [0.0] * 5)
    color_optics = intrinsics(color_numbers, rs.distortion.inverse_brown_conrady, LENS)
    device = rs.software_device()
    sensor = device.add_sensor("camera")
    depth = sensor.add_video_stream(stream(rs.stream.depth, 1, 2, rs.format.z16, depth_optics))
    color = sensor.add_video_stream(stream(rs.stream.color, 2, 3, rs.format.rgb8, color_optics))
    extrinsics = rs.extrinsics()
    extrinsics.rotation = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    extrinsics.translation = [-0.0591, 0, 0]
    depth.register_extrinsics_to(color, extrinsics)
    sensor.add_read_only_option(rs.option.depth_units, 0.001)
    syncer = rs.syncer()
    device.create_matcher(rs.matchers.default)
    sensor.open([depth, color])
    sensor.start(syncer)
    index = np.arange(DEPTH[0] * DEPTH[1])
    wall = np.where(index % 13 == 0, 0, 1500 + index % DEPTH[0] // 8)
    images = [
        (wall.astype(np.uint16).reshape(DEPTH[1], DEPTH[0]), depth, 2),
        (np.zeros((color_numbers[1], color_numbers[0], 3), np.uint8), color, 3),
    ]
    for number in range(1, 9):
        for pixels, profile, bytes_per_pixel in images:
            frame = rs.software_video_frame()
            frame.pixels, frame.bpp = pixels, bytes_per_pixel
            frame.stride = pixels.shape[1] * bytes_per_pixel
            frame.timestamp, frame.frame_number = number * 33.0, number
            frame.domain = rs.timestamp_domain.hardware_clock
            frame.profile = profile.as_video_stream_profile()
            frame.depth_units = 0.001
            sensor.on_video_frame(frame)
        frames = syncer.wait_for_frames()
        if frames.size() == 2:
            return device, frames
    raise SystemExit("the software device gave no pair")


for numbers in COLORS:
    device, frames = pair(numbers)
    align = rs.align(rs.stream.color)
    times = []
    for _ in range(ROUNDS):
        begun = time.perf_counter()
        align.process(frames)
        times.append((time.perf_counter() - begun) * 1e3)
    print(f"colour {numbers[0]}x{numbers[1]}: {sorted(times)[ROUNDS // 2]:.2f} ms")
