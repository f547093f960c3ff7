"""Trains the detector-segmenter on rendered pictures and writes it as ONNX.

python train_detector.py TRAIN VALIDATION OUT.onnx [--steps N]
"""

import argparse
import copy
import math
import time

import numpy as np
import torch
from torch.nn import functional as F

from detector import HEIGHT, WIDTH, Detector, Export, loss
from pictures import Pictures
from store import store

BATCH = 16
RATE = 2e-3
MOST_PEOPLE = 8
# Seen on less than this, people are neither asked for nor missed: pixels of the input.
LEAST_AREA, LEAST_HEIGHT = 24, 8


def load(folder):
    """All pictures at half size, letterboxed, and label maps of the same size."""
    pictures = Pictures(folder)
    images = np.full((len(pictures), HEIGHT, WIDTH, 3), 114, np.uint8)
    labels = np.zeros((len(pictures), HEIGHT, WIDTH), np.uint8)
    margin = (HEIGHT - 180) // 2
    for i in range(len(pictures)):
        four = pictures.image(i).reshape(180, 2, 320, 2, 3).astype(np.float32)
        images[i, margin : margin + 180] = four.mean((1, 3)) + 0.5
        labels[i, margin : margin + 180] = pictures.masks[i, 1::2, 1::2]
    return torch.from_numpy(images), torch.from_numpy(labels)


def boxes_of(labels):
    """Boxes of everybody in label maps [n, rows, columns]: truth, who is there, ignored boxes."""
    n = len(labels)
    truth = torch.zeros(n, MOST_PEOPLE, 4)
    there = torch.zeros(n, MOST_PEOPLE, dtype=torch.bool)
    ignored = torch.zeros(n, MOST_PEOPLE, 4)
    for who in range(MOST_PEOPLE):
        mask = labels == who + 1
        area = mask.sum((1, 2))
        rows, columns = mask.any(2).int(), mask.any(1).int()
        first = lambda line: line.argmax(1).float()
        last = lambda line: line.shape[1] - line.flip(1).argmax(1).float()
        box = torch.stack([first(columns), first(rows), last(columns), last(rows)], 1)
        large = (area >= LEAST_AREA) & (box[:, 3] - box[:, 1] >= LEAST_HEIGHT)
        there[:, who] = large
        truth[:, who] = torch.where(large[:, None], box, truth[:, who])
        ignored[:, who] = torch.where(((area > 0) & ~large)[:, None], box, ignored[:, who])
    return truth, there, ignored


def jittered(images, labels, random):
    """Nearer, further, mirrored; other light, other colours, other walls behind people, noise."""
    n = len(images)
    uniform = lambda low, high, *shape: low + (high - low) * torch.rand(*shape, generator=random)
    x = images.permute(0, 3, 1, 2).float() - 114
    zoom = uniform(math.log(0.7), math.log(1.35), n).exp()
    flip = torch.where(torch.rand(n, generator=random) < 0.5, -1.0, 1.0)
    aim = torch.zeros(n, 2, 3)
    aim[:, 0, 0], aim[:, 1, 1] = flip / zoom, 1 / zoom
    room = (1 - 1 / zoom).abs()
    aim[:, 0, 2] = uniform(-1, 1, n) * room
    aim[:, 1, 2] = uniform(-1, 1, n) * room
    grid = F.affine_grid(aim, x.shape, align_corners=False)
    x = F.grid_sample(x, grid, align_corners=False) + 114
    labels = F.grid_sample(labels[:, None].float(), grid, mode="nearest", align_corners=False)[:, 0]
    gain = uniform(-0.5, 0.35, n, 1, 1, 1).exp() * uniform(0.88, 1.12, n, 3, 1, 1)
    # Walls and floors of other shades, so that people stand out from what is behind them more or less.
    behind = uniform(-0.5, 0.5, n, 1, 1, 1).exp() * uniform(0.8, 1.25, n, 3, 1, 1)
    behind = torch.where(torch.rand(n, 1, 1, 1, generator=random) < 0.6, behind, torch.ones(1))
    x = torch.where(labels[:, None].round() > 0, x, x * behind)
    x = 255 * (x.clamp(0, 255) / 255) ** uniform(0.8, 1.25, n, 1, 1, 1) * gain
    swap = torch.rand(n, generator=random) < 0.3
    x[swap] = x[swap][:, torch.randperm(3, generator=random)]
    x = x + uniform(0, 4, n, 1, 1, 1) * torch.randn(x.shape, generator=random)
    return x.clamp(0, 255) / 255, labels.round()


@torch.no_grad()
def validate(network, images, labels):
    network.eval()
    sums = torch.zeros(3)
    for begin in range(0, len(images), 32):
        x = images[begin : begin + 32].permute(0, 3, 1, 2).float() / 255
        y = labels[begin : begin + 32].float()
        answer = network(x.contiguous(memory_format=torch.channels_last))
        parts = loss(answer, *boxes_of(y), y[:, 1::2, 1::2], network.centres)
        sums += torch.stack(parts) * len(x)
    network.train()
    return (sums / len(images)).tolist()


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("train"), parser.add_argument("validation"), parser.add_argument("out")
    parser.add_argument("--steps", type=int, default=2500)
    parser.add_argument("--start", help="weights to go on from")
    arguments = parser.parse_args()
    torch.set_num_threads(2)
    torch.manual_seed(1)
    random = torch.Generator().manual_seed(2)
    images, labels = load(arguments.train)
    validation = load(arguments.validation)
    network = Detector().to(memory_format=torch.channels_last)
    if arguments.start:
        network.load_state_dict(torch.load(arguments.start))
    mean = copy.deepcopy(network)
    print(f"{len(images)} pictures, {sum(p.numel() for p in network.parameters())} parameters", flush=True)
    optimiser = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=0.02)
    begun, order = time.monotonic(), []
    for step in range(1, arguments.steps + 1):
        if len(order) < BATCH:
            order = torch.randperm(len(images), generator=random).tolist()
        some = [order.pop() for _ in range(BATCH)]
        x, y = jittered(images[some], labels[some], random)
        answer = network(x.contiguous(memory_format=torch.channels_last))
        parts = loss(answer, *boxes_of(y), y[:, 1::2, 1::2], network.centres)
        total = parts[0] + 2 * parts[1] + parts[2]
        rate = RATE * min(1, step / 100) * (0.02 + 0.98 * (1 + math.cos(math.pi * step / arguments.steps)) / 2)
        for group in optimiser.param_groups:
            group["lr"] = rate
        optimiser.zero_grad()
        total.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 10.0)
        optimiser.step()
        follow(mean, network, min(0.995, step / (step + 20)))
        if step % 100 == 0:
            torch.save(mean.state_dict(), arguments.out + ".pt")
            said = " ".join(f"{p.item():.3f}" for p in parts)
            print(f"{step} {(time.monotonic() - begun) / 60:.1f} min: {said}; {validate(mean, *validation)}", flush=True)
    torch.save(mean.state_dict(), arguments.out + ".pt")
    store(Export(mean), torch.zeros(1, 3, HEIGHT, WIDTH), arguments.out, "images", ["answers", "prototypes"])


@torch.no_grad()
def follow(mean, network, share):
    """Moves the mean of the weights after them."""
    for m, w in zip(mean.state_dict().values(), network.state_dict().values()):
        m.lerp_(w, 1 - share) if m.is_floating_point() else m.copy_(w)


main()
